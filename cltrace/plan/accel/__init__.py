"""Which surfaces a ray can meet at all: tiles and light buffers, both of which are grids of cells with lists."""
