"""Reading TOML: documents, overrides, named sensors, and the checks that every table shares."""
