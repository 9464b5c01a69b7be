"""The protocol Strata of Infineon's radar boards."""
