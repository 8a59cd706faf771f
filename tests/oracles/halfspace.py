"""Lines of a lattice in the material on one side of a plane, beside a hole; and the arcs of circles in it: closed forms."""

import numpy as np

from rcsa_ident.toolpath.dexel import GRIDS

TURN = 2.0 * np.pi


def half_space(lattice, shape, normal, offset, hole=None):
    """Segments and counts of three grids: n . p < offset in the block around a lattice, but for an upright hole of a centre and radius."""
    segs, counts = [], []
    for a, one, two in GRIDS:
        seg, count = np.zeros((shape[one], shape[two], 2, 2)), np.zeros((shape[one], shape[two]), dtype=np.int16)
        for m, n in np.ndindex(count.shape):
            point = {one: lattice[0, one] + m * lattice[1, one], two: lattice[0, two] + n * lattice[1, two]}
            low, high = lattice[0, a] - 0.5 * lattice[1, a], lattice[0, a] + (shape[a] - 0.5) * lattice[1, a]
            rest = offset - sum(normal[k] * place for k, place in point.items())
            if normal[a] > 0.0:
                high = min(high, rest / normal[a])
            elif normal[a] < 0.0:
                low = max(low, rest / normal[a])
            elif rest <= 0.0:
                continue
            pieces = [(low, high)]
            if hole is not None:
                square = hole[2] ** 2 - sum((place - hole[k]) ** 2 for k, place in point.items() if k < 2)
                if square > 0.0:
                    half = np.sqrt(square)
                    pieces = [] if a == 2 else [(low, min(high, hole[a] - half)), (max(low, hole[a] + half), high)]
            for piece in pieces:
                if piece[1] > piece[0]:
                    seg[m, n, count[m, n]] = piece
                    count[m, n] += 1
        segs.append(seg)
        counts.append(count)
    return tuple(segs), tuple(counts)


def arcs_in(side, steep, share):
    """Arcs (k, 2) of a circle on which cos(angle - side) < share and sin(angle) > steep, by where they begin within a turn."""
    ends = [0.0, TURN]
    if abs(share) < 1.0:
        ends += [(side + np.arccos(share)) % TURN, (side - np.arccos(share)) % TURN]
    if abs(steep) < 1.0:
        ends += [np.arcsin(steep) % TURN, np.pi - np.arcsin(steep)]
    ends = np.sort(ends)
    middle = 0.5 * (ends[1:] + ends[:-1])
    cuts = (np.cos(middle - side) < share) & (np.sin(middle) > steep)
    found = []
    for k in np.flatnonzero(cuts):
        if found and found[-1][1] == ends[k]:
            found[-1][1] = ends[k + 1]
        else:
            found.append([ends[k], ends[k + 1]])
    if len(found) > 1 and found[0][0] == 0.0 and found[-1][1] == TURN:
        found[-1][1] += found.pop(0)[1]
    return np.array(found).reshape(-1, 2)


def ordered(arcs):
    """Arcs with their beginnings within a turn, in order."""
    turns = np.floor(arcs[:, :1] / TURN + 1e-7) * TURN
    arcs = arcs - turns
    return arcs[np.argsort(arcs[:, 0])]
