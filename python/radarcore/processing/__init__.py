"""From samples to spectra, peaks and what they say over time."""
