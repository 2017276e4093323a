"""Programs built on the benchmark: check, tune, gate, scaffold, fetch, warm-up, schema, pytest plugin."""
