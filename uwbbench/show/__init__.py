"""What people see: text, charts, pages, figures for print, and notebooks."""
