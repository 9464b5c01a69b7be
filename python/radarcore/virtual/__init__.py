"""A simulated scene or a recording behind the wire protocol of a real sensor."""
