"""Configuration: safe YAML with line numbers, checked models, and where shipped files are found."""
