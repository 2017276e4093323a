"""The dataset adapters of uwbbench, one module a format."""
