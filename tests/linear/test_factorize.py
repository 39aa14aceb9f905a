"""Every back end solves the same systems."""

import gc
import io
import sys

import numpy as np
import pytest
from scipy import sparse

import signedheat as sh
from refusals import refused
from shapes.surface_cases import sphere
from signedheat import linear
from signedheat.discretization import discretize
from signedheat.jobs import Announcement
from signedheat.linear import available_backends, elimination_order, factorize, pardiso, upper_triangle, whole
from signedheat.linear.threads import one_blas_thread
from signedheat.surfaces.vector_heat import vector_heat_matrix

backends = pytest.mark.parametrize("backend", available_backends())


@pytest.fixture(scope="module")
def surface():
    return discretize(sphere(3))


@backends
@pytest.mark.parametrize("ordered", [False, True])
def test_solves_vector_heat(surface, backend, ordered):
    matrix = vector_heat_matrix(surface.triangles, surface.spacing**2)
    order = surface.triangles.edges.elimination_order(surface.vertex_order) if ordered else None
    rng = np.random.default_rng(0)
    truth = rng.normal(size=(matrix.shape[0], 3)) + 1j * rng.normal(size=(matrix.shape[0], 3))
    factor = factorize(matrix, backend, order)
    assert factor.backend == backend
    np.testing.assert_allclose(factor.solve(whole(matrix) @ truth), truth, atol=1e-11)
    np.testing.assert_allclose(factor.solve(whole(matrix) @ truth[:, 0]), truth[:, 0], atol=1e-11)


@backends
def test_only_the_upper_triangle_is_read(backend):
    upper = sparse.csr_matrix([[4.0, 1.0, 0.5], [0.0, 3.0, 1.0], [0.0, 0.0, 2.0]])
    rhs = np.array([1.0, 2.0, 3.0])
    expected = np.linalg.solve(whole(upper).toarray(), rhs)
    for matrix in (upper, whole(upper), sparse.csr_matrix(upper + 7 * sparse.tril(upper.T, -1)), upper.tocoo()):
        np.testing.assert_allclose(factorize(matrix, backend).solve(rhs), expected, rtol=1e-13)


@backends
def test_an_indefinite_matrix_is_refused(backend):
    with refused(sh.errors.FactorizationError, "matrix"):
        factorize(sparse.csr_matrix([[1.0, 2.0], [2.0, 1.0]]), backend)


@backends
def test_the_same_bits_every_time(surface, backend):
    rhs = np.random.default_rng(1).normal(size=surface.triangles.n_edges)
    matrix = vector_heat_matrix(surface.triangles, surface.spacing**2)
    assert np.array_equal(factorize(matrix, backend).solve(rhs), factorize(matrix, backend).solve(rhs))


@backends
def test_factors_are_freed(backend):
    resource = pytest.importorskip("resource")
    n = 5_000
    matrix = sparse.diags_array([np.full(n, 3.0), np.ones(n - 1), np.full(n - 100, 0.1)], offsets=[0, 1, 100]).tocsr()

    def peak_after(repeats):
        for _ in range(repeats):
            factorize(matrix, backend, np.arange(n)).solve(np.ones(n))
        gc.collect()
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss

    before = peak_after(2)
    entries = factorize(matrix, backend, np.arange(n)).nonzeros
    assert 1024 * (peak_after(10) - before) < 4 * 8 * entries  # ten kept factors would be more than twice that


def test_blas_has_one_thread_where_more_would_wait():
    """That of MKL too, which is loaded with its first factor."""
    from threadpoolctl import threadpool_info, threadpool_limits

    for backend in available_backends():
        with threadpool_limits(2, "blas"), one_blas_thread():
            assert {each["num_threads"] for each in threadpool_info() if each["user_api"] == "blas"} == {1}
            factorize(sparse.identity(4, format="csr"), backend).solve(np.ones(4))


def test_an_unknown_backend_is_refused():
    with refused(ValueError):
        factorize(sparse.eye(2), "magic")


def test_the_environment_chooses(monkeypatch):
    monkeypatch.setenv("SIGNEDHEAT_BACKEND", "superlu")
    assert factorize(sparse.eye(2, format="csr")).backend == "superlu"


def test_upper_triangle_stores_the_whole_diagonal():
    upper = upper_triangle(sparse.csr_matrix([[0.0, 1.0], [1.0, 2.0]]))
    assert upper.indices[upper.indptr[:-1]].tolist() == [0, 1]
    np.testing.assert_allclose(upper.toarray(), [[0, 1], [0, 2]])


def test_dissection_is_an_order_and_saves_fill(surface):
    matrix = surface.integration.stiffness + sparse.eye(surface.triangles.n_vertices)
    order = elimination_order(matrix)
    assert np.array_equal(np.sort(order), np.arange(matrix.shape[0]))
    own, natural = (factorize(matrix, "superlu", o).nonzeros for o in (order, np.arange(matrix.shape[0])))
    assert own < 0.5 * natural


@pytest.mark.parametrize("edges", [[], [(0, 1)], [(0, 1), (0, 2), (0, 3), (0, 4)], [(0, 1), (2, 3), (3, 4), (2, 4)]])
def test_dissection_of_odd_graphs(edges):
    n = 5
    graph = sparse.eye(n, format="lil")
    for i, j in edges:
        graph[i, j] = 1.0
    assert sorted(elimination_order(graph.tocsr())) == list(range(n))


def test_dissection_of_many_parts_does_not_take_the_square_of_their_number():
    n = 100_000  # a quadratic search would take minutes
    assert len(elimination_order(sparse.eye(n, format="csr"))) == n


@pytest.mark.parametrize("backend", available_backends())
@pytest.mark.parametrize("dtype", [np.float64, np.complex128])
@pytest.mark.parametrize("made_on, solved_on", [(1, None), (None, 1), (1, 1), (None, None)])
def test_a_factor_outlives_a_change_of_threads(backend, dtype, made_on, solved_on):
    from threadpoolctl import threadpool_limits

    line = sparse.diags_array([-np.ones(119), 2 * np.ones(120), -np.ones(119)], offsets=[-1, 0, 1])
    matrix = sparse.kronsum(line, line, format="csr").astype(dtype)
    rhs = np.random.default_rng(0).standard_normal(matrix.shape[0]).astype(dtype)
    with threadpool_limits(made_on):
        factor = factorize(matrix, backend)
    with threadpool_limits(solved_on):
        solution = factor.solve(rhs)
        assert np.abs(matrix @ solution - rhs).max() < 1e-9
        assert all(np.array_equal(factor.solve(rhs), solution) for _ in range(5))
    with threadpool_limits(made_on):
        again = factorize(matrix, backend)
    assert np.array_equal(again.solve(rhs), solution)


@backends
def test_factors_like_others_are_independent_of_them(surface, backend):
    """Matrices with entries at the same places share an order and memory; each solves its own system whenever asked."""
    first = surface.stiffness + sparse.diags_array(np.linspace(1, 2, surface.triangles.n_vertices))
    second = first + sparse.diags_array(np.geomspace(1e-3, 1e6, surface.triangles.n_vertices))
    other = sparse.identity(surface.triangles.n_vertices, format="csr") * 3.0  # entries at fewer places
    matrices = [sparse.csr_matrix(matrix) for matrix in (first, second, other)]
    factors = [factorize(matrices[0], backend)]
    factors += [factorize(matrix, backend, like=factors[0]) for matrix in matrices[1:]]
    truth = np.random.default_rng(0).normal(size=matrices[0].shape[0])
    for k in (0, 1, 2, 0, 0, 1):
        np.testing.assert_allclose(factors[k].solve(whole(matrices[k]) @ truth), truth, atol=1e-9)
        np.testing.assert_array_equal(
            factors[k].solve(truth), factorize(matrices[k], backend, like=factors[0]).solve(truth)
        )
    indefinite = sparse.csr_matrix(first - sparse.diags_array(np.full(len(truth), 9.0)))
    with refused(sh.errors.FactorizationError, "matrix"):
        factorize(indefinite, backend, like=factors[0]).solve(truth)
    np.testing.assert_allclose(factors[0].solve(whole(matrices[0]) @ truth), truth, atol=1e-9)
    del factors[0]
    gc.collect()
    np.testing.assert_allclose(factors[0].solve(whole(matrices[1]) @ truth), truth, atol=1e-9)


def test_libraries_that_make_factors_anew_are_known_on_every_processor(surface):
    """Whatever its rounding: the answer of the second of two factors tells what the library can."""
    if not pardiso.is_available():
        pytest.skip("needs MKL")
    first = sparse.csr_matrix(sparse.triu(surface.stiffness + sparse.identity(surface.triangles.n_vertices)))
    second = first + sparse.diags_array(np.linspace(1, 2, first.shape[0]), format="csr")
    factor = pardiso.PardisoFactor(first)
    truth = np.random.default_rng(0).normal(size=first.shape[0])
    able = np.abs(factor._again(second).solve(whole(second) @ truth) - truth).max() < 1e-6
    assert (factor.like_this(second) is not None) == able


def test_libraries_that_cannot_make_a_factor_anew_are_not_asked_to(surface, monkeypatch):
    """As all of MKL before 2026.2: the answer would be that of the first matrix."""
    if not pardiso.is_available():
        pytest.skip("needs MKL")
    first = sparse.csr_matrix(sparse.triu(surface.stiffness + sparse.identity(surface.triangles.n_vertices)))
    monkeypatch.setattr(pardiso, "_makes_factors_anew", lambda: False)
    assert pardiso.PardisoFactor(first).like_this(first * 2.0) is None


def test_how_long_threads_of_mkl_wait_elsewhere_is_left_as_it_was():
    if not pardiso.is_available():
        pytest.skip("MKL is not installed")
    factor = pardiso.PardisoFactor(upper_triangle(sparse.csr_matrix(np.eye(3))))
    openmp = pardiso._openmp()
    if openmp is None:
        pytest.skip("the threads of MKL are not Intel's")
    before = openmp.kmp_get_blocktime()
    try:
        openmp.kmp_set_blocktime(37)
        np.testing.assert_array_equal(factor.solve(np.ones(3)), np.ones(3))
        assert openmp.kmp_get_blocktime() == 37
    finally:
        openmp.kmp_set_blocktime(before)


def test_where_pardiso_would_pay_it_is_named_once(monkeypatch):
    class Terminal(io.StringIO):
        def isatty(self):
            return True

    matrix = sparse.eye(5, format="csr") * 2.0
    monkeypatch.setattr(Announcement, "are_wanted", True)
    monkeypatch.setattr(linear, "MKL_UNKNOWNS", 5)
    monkeypatch.setattr(linear, "HAS_MKL", True)
    monkeypatch.setattr(linear, "available_backends", lambda: ["superlu"])
    monkeypatch.setattr(linear, "advise", Announcement("pip install mkl"))
    monkeypatch.setattr("sys.stderr", Terminal())
    factorize(matrix, backend="superlu")
    factorize(matrix[:4, :4])
    assert sys.stderr.getvalue() == ""
    for _ in range(2):
        factorize(matrix)
    assert sys.stderr.getvalue().count("pip install mkl") == 1
