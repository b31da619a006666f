"""Weights of layers for an eye: interpolation over the directions in which each facet was photographed.

A facet has sites on the unit sphere and simplices between them. The direction to the eye is carried to the nearest
point of that complex and written as a convex combination of up to three sites; with the views on a single ring only
its azimuth about the axis counts. All facets are answered at once, by the rules of docs/model-format.md.
"""

import numpy as np


class Facets:
    """The complexes and coefficients of all facets; raises ValueError where they are unsound.

    counts: facets × (sites, triangles, edges, rank); centers: facets × 3; directions: sites × 3, facet after facet;
    triangles (× 3) and edges (× 2) number sites within their facet; coefficients: sites × rank per facet, row by row,
    to be scaled by `scales`, one per layer; axis: that of a single ring, or None.
    """

    def __init__(self, counts, centers, directions, triangles, edges, coefficients, scales, axis):
        self.count = len(counts)
        self.layers = len(scales)
        self.ranks = counts[:, 3]
        self.centers = centers
        self.axis = axis
        self.site_counts = counts[:, 0]
        self.first_sites = _starts(counts[:, 0])[:-1]
        self.site_facets, self.triangle_facets, self.edge_facets = (
            np.repeat(np.arange(self.count), counts[:, column]) for column in range(3)
        )
        self.sites = _unit_sites(directions, self.site_facets)
        self.triangles = self._global(triangles, self.triangle_facets)
        self.edges = self._global(edges, self.edge_facets)
        self.inverses = _inverses(self.sites[self.triangles])
        self.tables = _tables(counts, coefficients, scales)

    def _global(self, simplices, facets):
        """Simplices by sites numbered over all facets."""
        wild = np.flatnonzero((simplices >= self.site_counts[facets][:, None]).any(axis=1))
        if wild.size:
            raise ValueError(f"facet {facets[wild[0]]} has an unsound triangulation")
        return simplices + self.first_sites[facets][:, None]

    def weights(self, eye):
        """Weights of all layers, facets × layers, as seen from `eye` (3, in the coordinates of the mesh).

        A facet without sites shows its first layer.
        """
        picked, shares = self.blend(np.asarray(eye, np.float64) - self.centers)
        weights = np.zeros((self.count, self.layers))
        for facet, (table, rank) in enumerate(zip(self.tables, self.ranks)):
            if len(table):
                weights[facet, :rank] = shares[facet] @ table[picked[facet]]
            else:
                weights[facet, 0] = 1.0
        return weights

    def blend(self, towards):
        """Sites within each facet and their shares, facets × 3 both, for directions that need not be unit."""
        norms = np.linalg.norm(towards, axis=1)
        is_direction = (norms > 1e-300) & np.isfinite(norms)
        d = towards / np.where(is_direction, norms, 1.0)[:, None]
        d[~is_direction] = 0.0
        picked, shares = self._by_azimuth(d) if self.axis is not None else self._by_direction(d)
        picked = picked - self.first_sites[:, None]
        # What cannot be normalised takes the first site, and so do unused entries, with no share.
        picked[~is_direction] = 0
        shares[~is_direction] = (1.0, 0.0, 0.0)
        picked[shares == 0.0] = 0
        return picked, shares

    def _by_azimuth(self, d):
        """The edge that spans the azimuth of d; the site nearest in azimuth where none does."""
        start, end = self.sites[self.edges[:, 0]], self.sites[self.edges[:, 1]]
        along, span = _turn(start, d[self.edge_facets], self.axis), _turn(start, end, self.axis)
        hits = np.flatnonzero((span > 0.0) & (along >= 0.0) & (along <= span))
        off = np.abs(_turn(self.sites, d[self.site_facets], self.axis))
        picked, shares = self._at(_first_least(off, self.site_facets, self.count))
        edge = _first(hits, self.edge_facets, self.count)
        has = edge >= 0
        t = along[edge[has]] / span[edge[has]]
        picked[has, :2] = self.edges[edge[has]]
        shares[has, :2] = np.stack([1.0 - t, t], axis=1)
        return picked, shares

    def _by_direction(self, d):
        """Barycentric weights in the triangle around d; outside all, the nearest point of edges and sites."""
        w = np.einsum("tij,tj->ti", self.inverses, d[self.triangle_facets])
        hits = np.flatnonzero((w.min(axis=1, initial=np.inf) >= -1e-12) & (w.sum(axis=1) > 1e-12))
        triangle = _first(hits, self.triangle_facets, self.count)
        picked, shares = self._nearest(d)
        has = triangle >= 0
        inside = np.maximum(w[triangle[has]], 0.0)
        picked[has] = self.triangles[triangle[has]]
        shares[has] = inside / inside.sum(axis=1, keepdims=True)
        return picked, shares

    def _nearest(self, d):
        cosines = np.einsum("si,si->s", self.sites, d[self.site_facets])
        site = _first_least(-cosines, self.site_facets, self.count)
        picked, shares = self._at(site)
        feet, t = _project_to_arcs(d[self.edge_facets], self.sites[self.edges[:, 0]], self.sites[self.edges[:, 1]])
        edge = _first_least(-feet, self.edge_facets, self.count)
        has = edge >= 0
        has[has] = feet[edge[has]] > cosines[site[has]]
        picked[has, :2] = self.edges[edge[has]]
        shares[has, :2] = np.stack([1.0 - t[edge[has]], t[edge[has]]], axis=1)
        return picked, shares

    def _at(self, site):
        """All weight on one site per facet; the first one's number where there is none."""
        picked = np.repeat(self.first_sites[:, None], 3, axis=1)
        picked[site >= 0, 0] = site[site >= 0]
        shares = np.zeros((self.count, 3))
        shares[:, 0] = 1.0
        return picked, shares


def _starts(counts):
    return np.concatenate([[0], np.cumsum(counts)])


def _unit_sites(directions, facets):
    norms = np.linalg.norm(directions, axis=1)
    far = np.flatnonzero(norms <= 0.5)
    if far.size:
        raise ValueError(f"facet {facets[far[0]]} has an unsound triangulation")
    return directions / norms[:, None]


def _inverses(corners):
    """Inverse of [a b c] per triangle, whose rows give barycentric weights up to scale; zero where there is none."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    rows = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=1)
    det = np.einsum("ti,ti->t", a, rows[:, 0])
    return np.where(det == 0.0, 0.0, 1.0 / np.where(det == 0.0, 1.0, det))[:, None, None] * rows


def _tables(counts, coefficients, scales):
    """Scaled coefficients per facet, sites × rank."""
    ends = _starts(counts[:, 0] * counts[:, 3])
    pairs = zip(counts, ends)
    return [coefficients[at : at + s * r].reshape(s, r) * scales[:r] for (s, _, _, r), at in pairs]


def _first(hits, facets, count):
    """The first of `hits` in each facet; -1 where there is none."""
    first = np.full(count, -1)
    first[facets[hits[::-1]]] = hits[::-1]
    return first


def _first_least(values, facets, count):
    """Where `values` is least in each facet, the first of equals; -1 where there is none."""
    return _first(np.lexsort((values, facets)), facets, count)


def _turn(start, towards, axis):
    """Angles in −π..π by which azimuths about `axis` are ahead of those of `start`."""
    flat = start - np.outer(start @ axis, axis)
    return np.arctan2(np.cross(flat, towards) @ axis, np.einsum("ij,ij->i", flat, towards))


def _project_to_arcs(d, a, b):
    """Feet of the perpendiculars from d on great arcs: their cosines to d (−∞ off the arc), their shares of it."""
    normals, is_arc = _unit(np.cross(a, b))
    feet, is_foot = _unit(d - normals * np.einsum("ij,ij->i", normals, d)[:, None])
    span = np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), np.einsum("ij,ij->i", a, b))
    along = np.arctan2(np.einsum("ij,ij->i", normals, np.cross(a, feet)), np.einsum("ij,ij->i", a, feet))
    is_on = is_arc & is_foot & (along >= 0.0) & (along <= span)
    t = np.where(is_on, along / np.where(span > 0.0, span, 1.0), 0.0)
    return np.where(is_on, np.einsum("ij,ij->i", feet, d), -np.inf), t


def _unit(v):
    norms = np.linalg.norm(v, axis=1)
    is_long = norms > 1e-12
    return v / np.where(is_long, norms, 1.0)[:, None], is_long
