"""The built-in stages of uwbbench, one module a family."""
