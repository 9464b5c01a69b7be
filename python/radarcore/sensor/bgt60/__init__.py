"""The chip BGT60TR13C: its registers, and the settings that they hold."""
