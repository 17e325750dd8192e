"""A small, stable set of figures by commit, which asv measures and keeps: ``make bench-history``.

Names, sizes and settings stay as they are; otherwise figures of different commits cannot be compared.
"""
