"""What the studies share: command line, result files, plots, Markdown."""
