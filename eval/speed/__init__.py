"""Speed measurements: `ehar bench`."""
