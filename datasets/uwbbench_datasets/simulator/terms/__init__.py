"""Terms of simulated scenes, one module a kind."""
