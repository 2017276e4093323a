"""What every page is made of: one template, style sheet and script, and the policy that lets nothing else run."""
