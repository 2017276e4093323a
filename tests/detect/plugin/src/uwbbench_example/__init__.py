"""A third party's plugin for uwbbench."""
