"""The protocol ComLib of Infineon's older radar boards."""
