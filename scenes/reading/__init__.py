"""Reading TOML: documents, overrides, named sensors, and the checks that all tables share."""
