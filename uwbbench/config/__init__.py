"""Configuration: detector files, overrides, captures by name, and where shipped files are found."""
