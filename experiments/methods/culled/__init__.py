"""Culled tiles: the cells' culling without alignment, which tells the gains of both apart."""
