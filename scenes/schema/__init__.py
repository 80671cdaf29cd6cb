"""The keys of a scene file, table by table."""
