"""The thesis' serial tiling construction (sec. 4.1.6.1): a stack, one tile at a time."""


def build_serial(field, level_min, level_max, threshold):
    """Leaves as ``(level, index)`` in Morton order for a field of ``4^depth`` values."""
    depth = (len(field).bit_length() - 1) // 2
    stack = [(level_min, index) for index in reversed(range(4**level_min))]
    leaves = []
    while stack:
        level, index = stack.pop()
        width = 4 ** (depth - level)
        if level == level_max or sum(field[index * width : (index + 1) * width]) <= threshold:
            leaves.append((level, index))
        else:
            stack.extend((level + 1, 4 * index + child) for child in (3, 2, 1, 0))
    return leaves
