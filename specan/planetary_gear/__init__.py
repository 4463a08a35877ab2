"""A planetary gear with a fixed ring: meshing forces in time, order lines of the ring's acceleration."""
