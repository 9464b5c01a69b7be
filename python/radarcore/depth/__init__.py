"""From depth images to radar frames."""
