"""The board's side of Strata, for tests and for virtual sensors."""
