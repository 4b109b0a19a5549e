//! The solvers against each other and against closed forms.

use std::sync::Arc;

use proptest::prelude::*;

use super::*;

const TIGHT: Tolerance = Tolerance { relative: 1e-11, absolute: 0.0 };

/// A number from -1 to 1 that looks random.
fn noise(seed: u64) -> f64 {
    let mixed = (seed + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    let mixed = (mixed ^ (mixed >> 29)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    (mixed >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

/// A symmetric positive definite block that looks random: the identity plus a product of a block
/// with itself.
fn positive<const B: usize>(seed: u64) -> Block<B> {
    let part: Block<B> =
        std::array::from_fn(|i| std::array::from_fn(|j| noise(seed * 31 + (B * i + j) as u64)));
    std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            let product: f64 = part[i].iter().zip(&part[j]).map(|(a, b)| a * b).sum();
            product + if i == j { 0.3 } else { 0.0 }
        })
    })
}

/// Springs along the edges of a grid of `count` cubed vertices, those of the outermost ones to a
/// wall: `spring(edge)` is the block of each.
fn grid<const B: usize>(count: usize, spring: impl Fn(u64) -> Block<B>) -> SparseMatrix<B> {
    let vertices = count.pow(3);
    let mut rows: Vec<std::collections::BTreeMap<u32, Block<B>>> =
        vec![Default::default(); vertices];
    let mut add = |row: usize, column: usize, block: &Block<B>, sign: f64| {
        let target = rows[row].entry(column as u32).or_insert([[0.0; B]; B]);
        for (target, block) in target.iter_mut().flatten().zip(block.iter().flatten()) {
            *target += sign * block;
        }
    };
    let mut edge = 0;
    for vertex in 0..vertices {
        for stride in [1, count, count * count] {
            let step = vertex / stride % count;
            edge += 1;
            let block = spring(edge);
            add(vertex, vertex, &block, 1.0);
            if step + 1 < count {
                let other = vertex + stride;
                add(other, other, &block, 1.0);
                add(vertex, other, &block, -1.0);
                add(other, vertex, &block, -1.0);
            }
            if step == 0 {
                add(vertex, vertex, &block, 1.0);
            }
        }
    }
    let offsets = std::iter::once(0).chain(rows.iter().scan(0, |end, row| {
        *end += row.len();
        Some(*end)
    }));
    let offsets = offsets.collect();
    let (columns, blocks) = rows.into_iter().flatten().unzip();
    SparseMatrix::from_parts(offsets, columns, blocks)
}

fn laplace(count: usize) -> SparseMatrix<1> {
    grid(count, |_| [[1.0]])
}

fn right_side<const B: usize>(rows: usize) -> Vec<[f64; B]> {
    (0..rows).map(|row| std::array::from_fn(|axis| noise((7 + 3 * row + axis) as u64))).collect()
}

/// The norm of the residual by that of the right side, computed anew.
fn residual<const B: usize>(
    matrix: &SparseMatrix<B>,
    right_side: &[[f64; B]],
    solution: &[[f64; B]],
) -> f64 {
    let mut image = vec![[0.0; B]; solution.len()];
    matrix.multiply(solution, &mut image);
    let rest: Vec<[f64; B]> = image
        .iter()
        .zip(right_side)
        .map(|(a, b)| std::array::from_fn(|axis| a[axis] - b[axis]))
        .collect();
    let norm = |vector: &[[f64; B]]| norms::<B, 1>(vector.as_chunks().0)[0];
    norm(&rest) / norm(right_side)
}

fn distance<const B: usize>(a: &[[f64; B]], b: &[[f64; B]]) -> f64 {
    let largest = a.as_flattened().iter().fold(0.0, |most: f64, value| most.max(value.abs()));
    let differences = a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| (a - b).abs());
    differences.fold(0.0, f64::max) / largest
}

fn solved<const B: usize>(
    solver: &dyn LinearSolver<B>,
    right_side: &[[f64; B]],
) -> (Vec<[f64; B]>, usize) {
    let mut solution = vec![[7.0; B]; right_side.len()];
    let convergence = solver.solve(right_side, &mut solution, TIGHT).unwrap();
    assert!(convergence.residual <= TIGHT.relative);
    (solution, convergence.iterations)
}

/// All solvers, for one matrix.
fn check_agreement<const B: usize>(matrix: SparseMatrix<B>) -> Result<(), TestCaseError> {
    let matrix = Arc::new(matrix);
    let right_side = right_side(matrix.rows());
    let double = MultigridSettings { precision: Precision::Double, ..MultigridSettings::default() };
    let solvers: [Box<dyn LinearSolver<B>>; 4] = [
        Box::new(Cholesky::new(Arc::clone(&matrix)).unwrap()),
        Box::new(Multigrid::new(Arc::clone(&matrix), MultigridSettings::default()).unwrap()),
        Box::new(Multigrid::new(Arc::clone(&matrix), double).unwrap()),
        Box::new(ConjugateGradients::new(Arc::clone(&matrix)).unwrap()),
    ];
    let exact = solved(solvers[0].as_ref(), &right_side).0;
    for solver in &solvers {
        let (solution, _) = solved(solver.as_ref(), &right_side);
        prop_assert!(residual(&matrix, &right_side, &solution) < 1e-10);
        prop_assert!(distance(&exact, &solution) < 1e-6);
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    /// Springs whose stiffness differs by up to four orders of magnitude.
    #[test]
    fn random_positive_matrices_are_solved_alike(seed in 0u64..1000, contrast in 0.0..2.0f64) {
        let spring = |edge: u64| {
            let scale = 10f64.powf(contrast * noise(seed * 100_003 + edge));
            positive::<3>(seed + edge).map(|row| row.map(|entry| scale * entry))
        };
        check_agreement(grid(9, spring))?;
        check_agreement(grid(11, |edge| [[10f64.powf(contrast * noise(seed + edge))]]))?;
    }
}

#[test]
fn iterations_hardly_grow_with_the_system() {
    let iterations = [12, 24, 36].map(|count| {
        let matrix = laplace(count);
        let right_side = right_side(matrix.rows());
        let solver = Multigrid::new(matrix, MultigridSettings::default()).unwrap();
        solved(&solver, &right_side).1
    });
    assert!(iterations[2] <= iterations[0] + 5 && iterations[2] <= 24, "{iterations:?}");
}

#[test]
fn strong_couplings_along_one_axis_are_coarsened_along_it() {
    let matrix = grid(20, |edge| [[if edge % 3 == 0 { 1000.0 } else { 1.0 }]]);
    let right_side = right_side(matrix.rows());
    let solver = Multigrid::new(matrix, MultigridSettings::default()).unwrap();
    let (_, iterations) = solved(&solver, &right_side);
    assert!(iterations <= 30, "{iterations}");
}

#[test]
fn what_stalls_is_finished_by_the_fallback() {
    let matrix = Arc::new(laplace(12));
    let right_side = right_side(matrix.rows());
    let settings = MultigridSettings { max_iterations: 2, ..MultigridSettings::default() };
    let solver = Multigrid::new(Arc::clone(&matrix), settings).unwrap();
    let (solution, iterations) = solved(&solver, &right_side);
    assert!(iterations > 2 && residual(&matrix, &right_side, &solution) < 1e-10);
    let (exact, _) = solved(&Cholesky::new(matrix).unwrap(), &right_side);
    assert!(distance(&exact, &solution) < 1e-9);
}

#[test]
fn a_solve_goes_on_from_where_it_is_told_to() {
    let matrix = laplace(14);
    let right_side = right_side(matrix.rows());
    for solver in [
        solver(Arc::new(matrix.clone()), &Halo::none()).unwrap(),
        Box::new(Cholesky::new(matrix).unwrap()),
    ] {
        let (mut solution, iterations) = solved(solver.as_ref(), &right_side);
        let kept = solution.clone();
        let loose = Tolerance { relative: 1e-10, absolute: 0.0 };
        assert_eq!(solver.solve_from(&right_side, &mut solution, loose).unwrap().iterations, 0);
        assert_eq!(solution, kept);
        solution.iter_mut().for_each(|value| value[0] *= 1.001);
        let again = solver.solve_from(&right_side, &mut solution, TIGHT).unwrap().iterations;
        assert!(again < iterations || iterations == 0);
        let convergence =
            solver.solve_from(&vec![[0.0]; kept.len()], &mut solution, TIGHT).unwrap();
        assert!(convergence.iterations == 0 && solution.iter().all(|value| value[0] == 0.0));
    }
}

#[test]
fn three_right_sides_are_solved_as_each_would_be() {
    let matrix = laplace(14);
    let solver = Multigrid::new(matrix, MultigridSettings::default()).unwrap();
    let sides = [
        right_side(solver.unknowns()),
        vec![[0.0]; solver.unknowns()],
        vec![[1.0]; solver.unknowns()],
    ];
    let together: Vec<[[f64; 1]; 3]> = (0..solver.unknowns())
        .map(|row| std::array::from_fn(|column| sides[column][row]))
        .collect();
    let mut solutions = vec![[[0.0]; 3]; together.len()];
    let convergence = solver.solve_three_from(&together, &mut solutions, [TIGHT; 3]).unwrap();
    for (column, side) in sides.iter().enumerate() {
        let (alone, iterations) = solved(&solver, side);
        assert_eq!(convergence[column].iterations, iterations);
        for (value, alone) in solutions.iter().zip(alone) {
            assert!(
                (value[column][0] - alone[0]).abs() < 1e-12
                    && (column != 1 || value[1][0].to_bits() == 0)
            );
        }
    }
}

#[test]
fn a_renewed_solver_is_the_one_of_the_new_matrix() {
    let springs = |seed: u64| Arc::new(grid(9, |edge| positive::<3>(seed + edge)));
    let right_side = right_side(springs(0).rows());
    let first = Multigrid::new(springs(0), MultigridSettings::default()).unwrap();
    let again = first.renewed(springs(0)).unwrap();
    assert_eq!(solved(&first, &right_side), solved(again.as_ref(), &right_side));
    let other = first.renewed(springs(1)).unwrap();
    let (solution, _) = solved(other.as_ref(), &right_side);
    assert!(residual(&springs(1), &right_side, &solution) < 1e-10);
    // Another pattern: nothing is used again.
    let small = first.renewed(Arc::new(grid(8, positive::<3>))).unwrap();
    assert_eq!(small.unknowns(), 512);
}

#[test]
fn a_similar_matrix_is_solved_with_the_preconditioner_there_is() {
    let springs = |change: f64| Arc::new(grid(12, |edge| [[1.0 + change * noise(edge)]]));
    let right_side = right_side(springs(0.0).rows());
    let first = Multigrid::new(springs(0.0), MultigridSettings::default()).unwrap();
    let (_, fresh) =
        solved(&Multigrid::new(springs(0.3), MultigridSettings::default()).unwrap(), &right_side);
    let (solution, iterations) = solved(&first.of_similar_matrix(springs(0.3)), &right_side);
    assert!(residual(&springs(0.3), &right_side, &solution) < 1e-10);
    assert!(iterations <= 2 * fresh, "{iterations} {fresh}");
}

#[test]
fn matrices_that_are_not_positive_are_refused() {
    let mut matrix = laplace(12);
    matrix.offsets_and_values_mut().2[0] = [[-1.0]];
    assert_eq!(
        Multigrid::new(matrix.clone(), MultigridSettings::default()).unwrap_err(),
        LinearError::Diagonal { row: 0 }
    );
    assert_eq!(Cholesky::new(matrix).unwrap_err(), LinearError::Factor);
    let solver = Multigrid::new(laplace(12), MultigridSettings::default()).unwrap();
    let mut solution = vec![[0.0]; solver.unknowns()];
    let bad = vec![[f64::NAN]; solver.unknowns()];
    assert_eq!(
        solver.solve(&bad, &mut solution, TIGHT),
        Err(LinearError::NotFinite { iteration: 0 })
    );
}

#[cfg(feature = "parallel")]
#[test]
fn the_same_bits_whatever_the_number_of_threads() {
    let matrix = Arc::new(grid(22, positive::<3>));
    let right_side = right_side(matrix.rows());
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let solver = Multigrid::new(Arc::clone(&matrix), MultigridSettings::default()).unwrap();
            solved(&solver, &right_side)
        })
    };
    let one = run(1);
    assert!(one.1 > 3 && one == run(2) && one == run(3));
}

#[test]
fn what_is_given_up_is_neither_set_up_nor_solved() {
    let cancellation = Cancellation::default();
    let solvers = Cancellable(cancellation.clone());
    let matrix = Arc::new(laplace(12));
    let made = || solvers.scalar(Arc::clone(&matrix), &Halo::none(), &[]);
    let (solver, right_side) = (made().unwrap(), right_side::<1>(matrix.rows()));
    let mut solution = vec![[0.0]; matrix.rows()];
    cancellation.cancel();
    assert!(!solvers.are_wanted());
    assert_eq!(solver.solve(&right_side, &mut solution, TIGHT), Err(LinearError::Cancelled));
    assert!(matches!(solver.renewed(Arc::clone(&matrix)), Err(LinearError::Cancelled)));
    assert!(matches!(made(), Err(LinearError::Cancelled)));
    cancellation.renew();
    let mut expected = solution.clone();
    solver.solve(&right_side, &mut solution, TIGHT).unwrap();
    BuiltIn
        .scalar(Arc::clone(&matrix), &Halo::none(), &[])
        .and_then(|own| own.solve(&right_side, &mut expected, TIGHT))
        .unwrap();
    assert_eq!(solution, expected);
}
