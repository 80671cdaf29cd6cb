"""The commands: each parses its options, calls the library, saves and prints."""
