"""Views as OpenEXR files."""
