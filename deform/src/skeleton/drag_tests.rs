use proptest::prelude::*;

use super::*;
use crate::vector::length;

/// The paper's matrix `Lc Mc^-1 Lc` assembled densely with its rows replaced, solved by elimination
/// with pivoting.
fn dense_reference(points: &[Vector], closed: bool, prescribed: &[(usize, f64)]) -> Vec<f64> {
    let count = points.len();
    let is_inner = |node: usize| closed || (node > 0 && node + 1 < count);
    let next = |node: usize| (node + 1) % count;
    let length = |node: usize| {
        let segment = subtract(points[next(node)], points[node]);
        length(segment)
    };
    let mut laplacian = vec![vec![0.0; count]; count];
    let mut mass = vec![1.0; count];
    for node in (0..count).filter(|&node| is_inner(node)) {
        let before = (node + count - 1) % count;
        laplacian[node][before] += 1.0 / length(before);
        laplacian[node][next(node)] += 1.0 / length(node);
        laplacian[node][node] -= 1.0 / length(before) + 1.0 / length(node);
        mass[node] = 0.5 * (length(before) + length(node));
    }
    let mut rows: Vec<Vec<f64>> = (0..count)
        .map(|i| {
            let entry =
                |j: usize| (0..count).map(|k| laplacian[i][k] / mass[k] * laplacian[k][j]).sum();
            (0..count).map(entry).chain([0.0]).collect()
        })
        .collect();
    let ends = if closed { vec![] } else { vec![(0, 0.0), (count - 1, 0.0)] };
    for &(node, value) in ends.iter().chain(prescribed) {
        rows[node] = vec![0.0; count + 1];
        rows[node][node] = 1.0;
        rows[node][count] = value;
    }
    for pivot in 0..count {
        let best = (pivot..count)
            .max_by(|&a, &b| rows[a][pivot].abs().total_cmp(&rows[b][pivot].abs()))
            .unwrap();
        rows.swap(pivot, best);
        let leading = rows[pivot].clone();
        for (_, row) in rows.iter_mut().enumerate().filter(|(number, _)| *number != pivot) {
            let factor = row[pivot] / leading[pivot];
            row.iter_mut()
                .zip(&leading)
                .skip(pivot)
                .for_each(|(value, leading)| *value -= factor * leading);
        }
    }
    (0..count).map(|row| rows[row][count] / rows[row][row]).collect()
}

fn line(count: usize) -> Vec<Vector> {
    (0..count).map(|number| [number as f64, 0.0, 0.0]).collect()
}

proptest! {
    #[test]
    fn it_is_the_paper_s_equation(
        steps in prop::collection::vec(([-1.0..1.0f64, -1.0..1.0f64, -1.0..1.0f64], 0.1..2.0f64), 5..30),
        closed: bool,
        drags in prop::collection::btree_map(0usize..30, -2.0..2.0f64, 1..5),
    ) {
        let mut points: Vec<Vector> = vec![[0.0; 3]];
        for (direction, length) in &steps {
            let norm = dot(*direction, *direction).sqrt().max(0.1);
            let last = points[points.len() - 1];
            points.push([0, 1, 2].map(|axis| last[axis] + (direction[axis] + 0.05) / norm * length));
        }
        let prescribed: Vec<(usize, f64)> = drags
            .into_iter()
            .filter(|&(node, _)| if closed { node < points.len() } else { node > 0 && node + 1 < points.len() })
            .collect();
        prop_assume!(!prescribed.is_empty());
        let dragged: Vec<usize> = prescribed.iter().map(|&(node, _)| node).collect();
        let curve = CurveDeformation::new(&points, closed, &dragged).unwrap();
        let by: Vec<Vector> = prescribed.iter().map(|&(_, value)| [value, 0.0, -2.0 * value]).collect();
        let moved = curve.displacement(&by);
        let wanted = dense_reference(&points, closed, &prescribed);
        for (moved, wanted) in moved.iter().zip(&wanted) {
            prop_assert!((moved[0] - wanted).abs() < 1e-6 * wanted.abs().max(1.0), "{} {wanted}", moved[0]);
            prop_assert_eq!(moved[1], 0.0);
            prop_assert_eq!(moved[2], -2.0 * moved[0]);
        }
        for (&node, &by) in dragged.iter().zip(&by) {
            prop_assert_eq!(moved[node], by);
        }
        if !closed {
            prop_assert_eq!((moved[0], moved[points.len() - 1]), ([0.0; 3], [0.0; 3]));
        }
    }
}

#[test]
fn on_even_nodes_it_is_the_natural_spline_that_central_differences_give() {
    // From numpy.linalg.solve of the assembled system for 6 segments of length 1 and node 2 dragged
    // by 1.
    let curve = CurveDeformation::new(&line(7), false, &[2]).unwrap();
    for (value, wanted) in
        curve.influence(0).unwrap().iter().zip([0.0, 10.0, 17.0, 18.0, 14.5, 8.0, 0.0])
    {
        assert!((value - wanted / 17.0).abs() < 1e-14, "{value} {wanted}");
    }
}

#[test]
fn a_long_curve_is_bent_as_a_beam_to_second_order() {
    // A simply supported beam under one force: w = 1 at the middle of [0, 1], w(s) = 3 s - 4 s^3 up
    // to there.
    let error = |count: usize| {
        let curve = CurveDeformation::new(&line(count + 1), false, &[count / 2]).unwrap();
        let exact = |node: usize| {
            let s = node.min(count - node) as f64 / count as f64;
            3.0 * s - 4.0 * s.powi(3)
        };
        let influence = curve.influence(0).unwrap();
        (0..=count).map(|node| (influence[node] - exact(node)).abs()).fold(0.0, f64::max)
    };
    let [coarse, fine, finest] = [error(10), error(100), error(10_000)];
    assert!(fine < coarse / 80.0 && coarse < 0.02, "{coarse} {fine}");
    // Fourth powers of 1e4 would leave nothing of 16 digits in the assembled matrix.
    assert!(finest < 2e-8, "{finest}");
}

#[test]
fn a_loop_is_carried_by_one_drag_and_bent_by_two() {
    let points: Vec<Vector> = (0..24)
        .map(|node| std::f64::consts::TAU * f64::from(node) / 24.0)
        .map(|angle| [angle.cos(), angle.sin(), 0.0])
        .collect();
    let one = CurveDeformation::new(&points, true, &[5]).unwrap();
    assert!(one.displacement(&[[1.0, 2.0, 3.0]]).iter().all(|moved| *moved == [1.0, 2.0, 3.0]));
    let two = CurveDeformation::new(&points, true, &[5, 17])
        .unwrap()
        .displacement(&[[0.0, 0.0, 1.0], [0.0; 3]]);
    for (node, moved) in two.iter().enumerate() {
        assert!(
            (moved[2] - two[(34 - node) % 24][2]).abs() < 1e-13,
            "symmetric about the dragged node"
        );
        assert!((-1e-13..=1.0 + 1e-13).contains(&moved[2]));
    }
}

#[test]
fn what_cannot_be_dragged_is_named() {
    let fails = |points: &[Vector], closed, dragged: &[usize]| {
        CurveDeformation::new(points, closed, dragged).unwrap_err().to_string()
    };
    assert!(fails(&line(4), false, &[0]).starts_with("node 0 cannot be dragged"));
    assert!(fails(&line(4), false, &[3]).starts_with("node 3 cannot be dragged"));
    assert!(fails(&line(4), true, &[4]).starts_with("node 4 cannot be dragged"));
    assert_eq!(fails(&line(4), false, &[1, 2, 1]), "node 1 is dragged twice");
    let mut same = line(5);
    same[3] = same[2];
    assert!(
        fails(&same, false, &[1]).starts_with("nodes 2 and 3 of the curve are at the same place")
    );
    same[3] = [1e308, -1e308, 1e308];
    assert!(CurveDeformation::new(&same, false, &[1]).is_err());
    assert_eq!(
        CurveDeformation::new(&line(3), false, &[]).unwrap().displacement(&[]),
        [[0.0; 3]; 3]
    );
}

#[test]
fn only_the_curves_of_the_dragged_nodes_move() {
    let mut nodes = line(9);
    nodes.extend((1..=4).map(|number| [4.0, f64::from(number), 0.0]));
    let curves = vec![vec![0, 1, 2, 3, 4], vec![4, 5, 6, 7, 8], vec![4, 9, 10, 11, 12]];
    let skeleton = Skeleton::new(nodes, curves, vec![]).unwrap();
    let drag = SkeletonDrag::new(&skeleton, &[10, 2, 11]).unwrap();
    assert_eq!(drag.curves().collect::<Vec<_>>(), [0, 2]);
    let moved = drag.displacement(&[[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.5]]);
    assert_eq!(
        (moved[10], moved[2], moved[11]),
        ([0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.5])
    );
    assert!([0, 4, 5, 6, 7, 8, 12].iter().all(|&node| moved[node] == [0.0; 3]));
    assert!(drag.displacement(&[[0.0; 3]; 3]).iter().all(|moved| *moved == [0.0; 3]));

    let error = SkeletonDrag::new(&skeleton, &[0]).unwrap_err();
    assert_eq!(
        error.to_string(),
        "node 0 of the skeleton is the end of a curve and is pinned; the nearest node that can be dragged is node 1 at (1, 0, 0)"
    );
    assert_eq!(SkeletonDrag::new(&skeleton, &[2, 2]).unwrap_err(), DragError::Twice { node: 2 });
    assert!(
        SkeletonDrag::new(&skeleton, &[99]).unwrap_err().to_string().contains("is on no curve")
    );
}

#[test]
fn a_loop_at_a_branch_node_is_pinned_there_and_a_free_one_nowhere() {
    let nodes =
        vec![[-1.0, 0.0, 0.0], [0.0; 3], [1.0, 1.0, 0.0], [2.0, 0.0, 0.0], [1.0, -1.0, 0.0]];
    let skeleton =
        Skeleton::new(nodes.clone(), vec![vec![0, 1], vec![1, 2, 3, 4, 1]], vec![]).unwrap();
    let moved = SkeletonDrag::new(&skeleton, &[3]).unwrap().displacement(&[[0.0, 0.0, 1.0]]);
    assert_eq!((moved[0], moved[1], moved[3]), ([0.0; 3], [0.0; 3], [0.0, 0.0, 1.0]));

    let skeleton = Skeleton::new(nodes[1..].to_vec(), vec![vec![0, 1, 2, 3, 0]], vec![]).unwrap();
    let moved = SkeletonDrag::new(&skeleton, &[0]).unwrap().displacement(&[[0.0, 0.0, 1.0]]);
    assert!(moved.iter().all(|moved| *moved == [0.0, 0.0, 1.0]));
}
