"""The board's side of the wire protocols, for tests and for virtual sensors."""
