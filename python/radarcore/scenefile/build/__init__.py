"""From the tables of a scene file to radar, bodies and motions."""
