import matplotlib as mpl
import pytest


@pytest.fixture(autouse=True)
def _no_window():
    """Figures are drawn in memory and closed."""
    backend = mpl.get_backend()
    mpl.use("Agg")
    yield
    from matplotlib import pyplot as plt

    plt.close("all")
    mpl.use(backend)
