"""Settings and captures of Texas Instruments' radar chips."""
