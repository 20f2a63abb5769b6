"""Linear model with random intercepts of participants and of their cells, at given variances.

``y = X beta + u_participant + u_cell + e``, ``V = sum_a v_a G_a`` with ``G_a`` the matrix of
ones inside the participants, inside the cells, and the identity. Rows of one cell share their
fixed effects, so their mean and the sum of squares about it carry all that the rows say: the
model is kept as one row a cell, scaled by the root of its count, in one block a participant.
"""

from dataclasses import dataclass, replace

import numpy as np

from jointz.kernels.statistics.mixed_model_likelihood import random_intercept_variances

#: Steps of the scoring, and halvings of one step, before giving up.
_MOST_STEPS = 200
_MOST_HALVINGS = 40
#: A step under this share of all variance is none.
_NO_STEP = 1e-13


@dataclass(frozen=True, slots=True)
class CellBlocks:
    """The rows of a table by participant, one row a cell.

    ``X`` (b, m, p): fixed effects times the root of the cell's count; ``y`` (b, m): mean of the
    cell times the root of its count; ``G`` (k, b, m, m): covariance structure of each component:
    participants, cells where they are in the model, residual; ``missing`` (b, m): 1 where there is
    no cell; ``within_df``, ``within_ss``: number of rows beyond one per cell, and sum of squares
    about the cells' means.
    """

    X: np.ndarray
    y: np.ndarray
    G: np.ndarray
    missing: np.ndarray
    within_df: float
    within_ss: float

    def without(self, component: int) -> "CellBlocks":
        """Return the model without one of its components, not the last of ``G``, the residual."""
        return replace(self, G=np.delete(self.G, component, axis=0))


@dataclass(frozen=True, slots=True)
class ComponentsFit:
    """Fixed effects and what the likelihood says of the variances.

    ``beta`` (p,): fixed effects; ``covariance`` (p, p): of the fixed effects, the variances taken
    as known; ``variances`` (k,): of participants, of cells where they are in the model, and of the
    residual; ``information_gradient`` (k, p, p): derivative of the inverse of ``covariance`` by the
    variances; ``information_products`` (k, k, p, p): Q of Kenward and Roger;
    ``expected_information``, ``observed_information`` (k, k): information on the variances, from
    the restricted likelihood; ``score`` (k,): gradient of the restricted log-likelihood;
    ``deviance``: -2 times the restricted log-likelihood, without its constant.
    """

    beta: np.ndarray
    covariance: np.ndarray
    variances: np.ndarray
    information_gradient: np.ndarray
    information_products: np.ndarray
    expected_information: np.ndarray
    observed_information: np.ndarray
    score: np.ndarray
    deviance: float

    @property
    def covariance_gradient(self) -> np.ndarray:
        """(k, p, p) of ``covariance`` by the variances."""
        return np.asarray(-self.covariance @ self.information_gradient @ self.covariance)

    @property
    def variance_covariance(self) -> np.ndarray:
        """(k, k) of the variances from the observed information; 0 for those at 0."""
        free = np.flatnonzero(self.variances > 0)
        covariance = np.zeros_like(self.observed_information)
        at = np.ix_(free, free)
        covariance[at] = np.linalg.inv(self.observed_information[at])
        return covariance


def cell_blocks(
    design: np.ndarray, response: np.ndarray, participant: np.ndarray, *, cell: np.ndarray | None
) -> CellBlocks:
    """Return the rows of a table by participant, one row a cell.

    ``design`` (n, p): columns of the fixed effects; ``response`` (n,): finite; ``participant``,
    ``cell`` (n,): of every row, 0, 1, ...
    """
    X, y = np.asarray(design, dtype=float), np.asarray(response, dtype=float)
    index = np.arange(y.size) if cell is None else np.asarray(cell)
    first = np.unique(index, return_index=True)[1]
    owner = np.asarray(participant)[first]
    if (owner[index] != participant).any() or (X[first][index] != X).any():
        raise ValueError(
            "cell_blocks: expected cells of one participant and one set of fixed effects each"
        )
    count = np.bincount(index).astype(float)
    mean = np.bincount(index, weights=y) / count
    place = _place_in_block(owner)
    shape = (int(owner.max()) + 1, int(place.max()) + 1)
    root, values = np.zeros(shape), np.zeros(shape)
    effects = np.zeros((*shape, X.shape[1]))
    root[owner, place] = np.sqrt(count)
    values[owner, place] = np.sqrt(count) * mean
    effects[owner, place] = np.sqrt(count)[:, None] * X[first]
    missing = (root == 0).astype(float)
    G = [root[:, :, None] * root[:, None, :], _diagonal(1.0 - missing)]
    if cell is not None:
        G.insert(1, _diagonal(root**2))
    return CellBlocks(
        X=effects,
        y=values,
        G=np.stack(G),
        missing=missing,
        within_df=float(y.size - count.size),
        within_ss=float(((y - mean[index]) ** 2).sum()),
    )


def _place_in_block(owner: np.ndarray) -> np.ndarray:
    order = np.argsort(owner, kind="stable")
    starts = np.concatenate([[0], np.cumsum(np.bincount(owner))[:-1]])
    place = np.empty_like(owner)
    place[order] = np.arange(owner.size) - starts[owner[order]]
    return place


def _diagonal(values: np.ndarray) -> np.ndarray:
    return np.asarray(values[:, :, None] * np.eye(values.shape[1]))


def evaluate_components(blocks: CellBlocks, variances: np.ndarray) -> ComponentsFit:
    """Return fixed effects, score and information at given variances.

    ``variances`` (k,): in the order of ``blocks.G``. Kenward and Roger 1997, doi:10.2307/2533558,
    with the signs of pbkrtest (Halekoh and Hojsgaard 2014, doi:10.18637/jss.v059.i09).
    """
    X, y, G = blocks.X, blocks.y, blocks.G
    v = np.asarray(variances, dtype=float)
    V = np.tensordot(v, G, axes=1) + _diagonal(blocks.missing)
    Vi = np.linalg.inv(V)
    ViX = Vi @ X
    information = np.einsum("bmp,bmq->pq", X, ViX)
    C = np.linalg.inv(information)
    beta = C @ np.einsum("bmp,bm->p", ViX, y)
    residual = y - X @ beta
    Py = (Vi @ residual[:, :, None])[:, :, 0]
    ViG, GViX, GPy = Vi @ G, G @ ViX, (G @ Py[:, :, None])[..., 0]
    P = -np.einsum("bmp,kbmq->kpq", ViX, GViX)
    Q = np.einsum("kbmp,lbmq->klpq", GViX, Vi @ GViX)
    CP = C @ P
    traces = np.einsum("kbmm->k", ViG) + np.einsum("kpp->k", CP)
    quadratic = GPy.reshape(v.size, -1) @ Py.ravel()
    products = np.einsum("kbmn,lbnm->kl", ViG, ViG)
    expected = products - 2.0 * np.einsum("pq,klqp->kl", C, Q) + np.einsum("kpq,lqp->kl", CP, CP)
    XViGPy = np.einsum("bmp,kbm->kp", ViX, GPy)
    observed = np.einsum("kbm,lbm->kl", GPy, (Vi @ GPy[..., None])[..., 0])
    observed -= XViGPy @ C @ XViGPy.T
    s, df, ss = v[-1], blocks.within_df, blocks.within_ss
    traces[-1] += df / s
    quadratic[-1] += ss / s**2
    expected[-1, -1] += df / s**2
    observed[-1, -1] += ss / s**3
    logs = np.linalg.slogdet(V)[1].sum() + np.linalg.slogdet(information)[1] + df * np.log(s)
    return ComponentsFit(
        beta=beta,
        covariance=C,
        variances=v,
        information_gradient=P,
        information_products=Q,
        expected_information=expected / 2.0,
        observed_information=observed - expected / 2.0,
        score=(quadratic - traces) / 2.0,
        deviance=float(logs + residual.ravel() @ Py.ravel() + ss / s),
    )


def fit_components(blocks: CellBlocks) -> ComponentsFit:
    """Fit fixed effects and variances by restricted maximum likelihood.

    Variances at the bound are exactly 0. Agrees with lme4 (Bates et al. 2015,
    doi:10.18637/jss.v067.i01) to the tolerance of its optimiser.
    """
    k = blocks.G.shape[0]
    total = float((blocks.y**2).sum() + blocks.within_ss) / max(blocks.missing.size, 1)
    alone = _residual_variance(blocks, total)
    starts = [np.full(k, alone / k)]
    starts += [np.where(np.arange(k) == a, 0.0, alone / k) for a in range(k - 1)]
    return min((_maximise(blocks, start) for start in starts), key=lambda fit: fit.deviance)


def _residual_variance(blocks: CellBlocks, total: float) -> float:
    """Return the variance with all other components at 0."""
    start = np.zeros(blocks.G.shape[0])
    start[-1] = total if total > 0 else 1.0
    residual = blocks.y - blocks.X @ evaluate_components(blocks, start).beta
    rows = blocks.missing.size - blocks.missing.sum() + blocks.within_df
    return float(((residual**2).sum() + blocks.within_ss) / (rows - blocks.X.shape[2]))


def _maximise(blocks: CellBlocks, start: np.ndarray) -> ComponentsFit:
    fit = evaluate_components(blocks, start)
    for _ in range(_MOST_STEPS):
        moved = _shortened(blocks, fit, _newton_step(fit))
        still = np.abs(moved.variances - fit.variances).max() <= _NO_STEP * fit.variances.sum()
        fit = moved
        if still:
            return fit
    raise ValueError(
        f"fit_components: expected variances that can be told apart, no maximum of the likelihood "
        f"in {_MOST_STEPS} steps"
    )


def _newton_step(fit: ComponentsFit) -> np.ndarray:
    free = (fit.variances > 0) | (fit.score > 0)
    step = np.zeros_like(fit.variances)
    while True:
        at = np.ix_(np.flatnonzero(free), np.flatnonzero(free))
        information = fit.observed_information[at]
        if np.linalg.eigvalsh(information).min() <= 0:
            information = fit.expected_information[at]
        step[:] = 0.0
        step[free] = np.linalg.solve(information, fit.score[free])
        outside = free & (fit.variances == 0) & (step < 0)
        if not outside.any():
            return step
        free &= ~outside


def _shortened(blocks: CellBlocks, fit: ComponentsFit, step: np.ndarray) -> ComponentsFit:
    """Return the fit after a step, halved until the likelihood does not fall."""
    for halving in range(_MOST_HALVINGS):
        variances = np.maximum(fit.variances + 0.5**halving * step, 0.0)
        if variances[-1] > 0.01 * fit.variances[-1]:
            moved = evaluate_components(blocks, variances)
            if moved.deviance <= fit.deviance + 1e-12 * abs(fit.deviance):
                return moved
    return fit


def fit_random_intercept(
    design: np.ndarray, response: np.ndarray, group: np.ndarray
) -> ComponentsFit:
    """Fit fixed effects and one random intercept by restricted maximum likelihood.

    ``design`` (n, p): with the intercept; ``response``, ``group`` (n,), such as the participant of
    a row, or the trial of a pulse. Agrees with lme4 (Bates et al. 2015, doi:10.18637/jss.v067.i01).
    Misleads with random slopes, and is somewhat liberal with few groups and a variance at 0.
    """
    variances = random_intercept_variances(design, response, group)
    owner = np.unique(group, return_inverse=True)[1]
    return evaluate_components(cell_blocks(design, response, owner, cell=None), variances)


def likelihood_ratio(blocks: CellBlocks, fit: ComponentsFit, component: int) -> float:
    """Return twice the gain in restricted log-likelihood by one of the variances.

    ``fit`` of ``blocks``, the model with the variance; ``component``: its place.
    """
    if fit.variances[component] == 0:
        return 0.0
    return max(fit_components(blocks.without(component)).deviance - fit.deviance, 0.0)
