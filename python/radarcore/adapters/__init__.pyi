from radarcore.adapters import images as images
