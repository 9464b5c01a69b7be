"""Counterparts of devices and servers, for the tests of what talks to them."""
