"""Which surfaces a ray can meet at all: tiles of the picture and light buffers, both grids of cells with lists."""
