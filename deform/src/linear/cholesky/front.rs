//! Dense arithmetic for the fronts of a sparse factor, on strips of four rows.
//!
//! Short loops over small arrays without bounds to check: engines that compile as they run, as
//! browsers do, have it fast from the start, where a general matrix library first costs them more
//! to compile than to run.

/// Rows of one strip.
pub(super) const LANES: usize = 4;

/// Four rows of one column.
pub(super) type Lanes = [f64; LANES];

/// Strips that are brought up to date together, so that each is read from memory once for all of
/// them.
const BLOCK: usize = 8;

/// How many columns with all their strips make `count` rows or columns.
pub(super) fn strips(count: usize) -> usize {
    count.div_ceil(LANES)
}

/// Where strip `strip` of a lower triangle begins: each has the columns up to the end of its own
/// block.
pub(super) fn triangle(strip: usize) -> usize {
    LANES * (strip * (strip + 1) / 2)
}

/// Where strip `strip` of a front with `own` strips of own rows begins: those are a lower triangle,
/// all others have every own column.
pub(super) fn trapezoid(own: usize, strip: usize) -> usize {
    if strip <= own { triangle(strip) } else { triangle(own) + LANES * own * (strip - own) }
}

/// `target[j][i] -= sum over k of a[k][i] b[k][j]`.
///
/// A function of its own where code is compiled as it runs: it is known to be worth compiling well
/// after its first few calls.
#[cfg_attr(target_arch = "wasm32", inline(never))]
#[cfg_attr(not(target_arch = "wasm32"), inline(always))]
fn update<const FUSED: bool>(target: &mut [Lanes; LANES], a: &[Lanes], b: &[Lanes]) {
    let mut sums = [[0.0; LANES]; LANES];
    if FUSED {
        // Two sums of each, since one would wait for itself.
        let mut others = [[0.0; LANES]; LANES];
        let ((a, a_last), (b, b_last)) = (a.as_chunks::<2>(), b.as_chunks::<2>());
        for (a, b) in a.iter().zip(b) {
            for j in 0..LANES {
                for i in 0..LANES {
                    sums[j][i] = a[0][i].mul_add(b[0][j], sums[j][i]);
                }
            }
            for j in 0..LANES {
                for i in 0..LANES {
                    others[j][i] = a[1][i].mul_add(b[1][j], others[j][i]);
                }
            }
        }
        for (a, b) in a_last.iter().zip(b_last) {
            for j in 0..LANES {
                for i in 0..LANES {
                    sums[j][i] = a[i].mul_add(b[j], sums[j][i]);
                }
            }
        }
        for (sums, others) in sums.iter_mut().zip(&others) {
            for i in 0..LANES {
                sums[i] += others[i];
            }
        }
    } else {
        for (a, b) in a.iter().zip(b) {
            for j in 0..LANES {
                for i in 0..LANES {
                    sums[j][i] += a[i] * b[j];
                }
            }
        }
    }
    for (column, sums) in target.iter_mut().zip(&sums) {
        for i in 0..LANES {
            column[i] -= sums[i];
        }
    }
}

/// Eliminates the own columns of a front of `rows` strips, `own` of which are those of its own
/// rows, and subtracts what they do to the strips below from the lower triangle `left_over`.
/// Whether the front is positive definite.
pub(super) fn eliminate(
    values: &mut [Lanes],
    own: usize,
    rows: usize,
    left_over: &mut [Lanes],
) -> bool {
    #[cfg(target_arch = "x86_64")]
    {
        struct Task<'a>(&'a mut [Lanes], usize, usize, &'a mut [Lanes]);
        impl pulp::WithSimd for Task<'_> {
            type Output = bool;

            #[inline(always)]
            fn with_simd<S: pulp::Simd>(self, _: S) -> bool {
                let Task(values, own, rows, left_over) = self;
                // Where four numbers fit one register there is a fused multiplication and addition,
                // too.
                if S::F64_LANES >= LANES {
                    eliminate_with::<true>(values, own, rows, left_over)
                } else {
                    eliminate_with::<false>(values, own, rows, left_over)
                }
            }
        }
        pulp::Arch::new().dispatch(Task(values, own, rows, left_over))
    }
    #[cfg(not(target_arch = "x86_64"))]
    {
        eliminate_with::<false>(values, own, rows, left_over)
    }
}

#[inline(always)]
fn eliminate_with<const FUSED: bool>(
    values: &mut [Lanes],
    own: usize,
    rows: usize,
    left_over: &mut [Lanes],
) -> bool {
    for first in (0..own).step_by(BLOCK) {
        let last = (first + BLOCK).min(own);
        let (above, below) = values.split_at_mut(triangle(last));
        // What the columns before the block do to it.
        let done = LANES * first;
        for strip in first..last {
            let (others, row) = above.split_at_mut(triangle(strip));
            let (old, new) = row[..LANES * (strip + 1)].split_at_mut(done);
            let (new, corner) = new.as_chunks_mut::<LANES>().0.split_at_mut(strip - first);
            for (other, target) in (first..strip).zip(new) {
                update::<FUSED>(target, old, &others[triangle(other)..triangle(other) + done]);
            }
            for corner in corner {
                update::<FUSED>(corner, old, old);
            }
        }
        // The block itself.
        for block in first..last {
            let column = LANES * block;
            let (above, mut rest) = above.split_at_mut(triangle(block + 1));
            let (before, corner) = above[triangle(block) + done..].split_at_mut(column - done);
            let Some(corner) = corner.first_chunk_mut::<LANES>() else { return false };
            update::<FUSED>(corner, before, before);
            if !eliminate_corner(corner) {
                return false;
            }
            for strip in block + 1..last {
                let (row, after) = rest.split_at_mut(LANES * (strip + 1));
                solve_row::<FUSED>(&mut row[done..], before, corner);
                rest = after;
            }
        }
        let mut rest = below;
        for strip in last..rows {
            let (row, after) = rest.split_at_mut(LANES * (strip + 1).min(own));
            let (old, new) = row.split_at_mut(done);
            for (other, target) in (first..last).zip(new.as_chunks_mut::<LANES>().0) {
                update::<FUSED>(target, old, &above[triangle(other)..triangle(other) + done]);
            }
            for block in first..last {
                let pivot = &above[triangle(block)..triangle(block + 1)];
                let (before, corner) = pivot[done..].split_at(LANES * block - done);
                if let Some(corner) = corner.first_chunk() {
                    solve_row::<FUSED>(new, before, corner);
                }
            }
            rest = after;
        }
    }
    let boundary = &values[triangle(own)..];
    let length = LANES * own;
    for first in (0..rows - own).step_by(BLOCK) {
        let others = &boundary[first * length..];
        for strip in first..rows - own {
            let row = &mut left_over[triangle(strip)..triangle(strip + 1)][LANES * first..];
            let a = &boundary[strip * length..(strip + 1) * length];
            for (other, target) in row.as_chunks_mut::<LANES>().0.iter_mut().take(BLOCK).enumerate()
            {
                update::<FUSED>(target, a, &others[other * length..(other + 1) * length]);
            }
        }
    }
    true
}

/// Four more columns of a strip: what the columns before them do to them, and then what the corner
/// of their block does.
#[inline(always)]
fn solve_row<const FUSED: bool>(row: &mut [Lanes], before: &[Lanes], corner: &[Lanes; LANES]) {
    let (old, new) = row.split_at_mut(before.len());
    if let Some(target) = new.first_chunk_mut() {
        update::<FUSED>(target, old, before);
        solve_corner(corner, target);
    }
}

/// The Cholesky factor of four columns of four rows, whose upper triangle becomes 0. Whether there
/// is one.
fn eliminate_corner(corner: &mut [Lanes; LANES]) -> bool {
    for j in 0..LANES {
        for k in 0..j {
            for i in j..LANES {
                corner[j][i] -= corner[k][i] * corner[k][j];
            }
        }
        let pivot = corner[j][j].sqrt();
        if !(pivot > 0.0 && pivot.is_finite()) {
            return false;
        }
        for (i, value) in corner[j].iter_mut().enumerate() {
            *value = if i < j { 0.0 } else { *value / pivot };
        }
        corner[j][j] = pivot;
    }
    true
}

/// `X C^T = T` for the factor `C` of a corner; `X` takes the place of `T`.
#[inline(always)]
#[expect(
    clippy::needless_range_loop,
    reason = "in this form it is compiled to wide registers, which takes a fifth off the whole"
)]
fn solve_corner(corner: &[Lanes; LANES], target: &mut [Lanes; LANES]) {
    for j in 0..LANES {
        for k in 0..j {
            for i in 0..LANES {
                target[j][i] -= target[k][i] * corner[k][j];
            }
        }
        for i in 0..LANES {
            target[j][i] /= corner[j][j];
        }
    }
}

/// `C y = b` for the own rows of a front, and what that changes below: `values` are the rows of the
/// front.
pub(super) fn forward(front: &[Lanes], own: usize, values: &mut [Lanes]) {
    let mut rest = front;
    for strip in 0..values.len() {
        let (row, after) = rest.split_at(LANES * (strip + 1).min(own));
        rest = after;
        let (known, unknown) = values.split_at_mut(strip);
        let Some(value) = unknown.first_mut() else { return };
        let (columns, corner) = row.as_chunks::<LANES>().0.split_at(strip.min(own));
        let sum = times(columns, known);
        for i in 0..LANES {
            value[i] -= sum[i];
        }
        if let [corner] = corner {
            for j in 0..LANES {
                value[j] /= corner[j][j];
                for i in j + 1..LANES {
                    value[i] -= corner[j][i] * value[j];
                }
            }
        }
    }
}

/// The product of a strip with a vector.
#[cfg_attr(target_arch = "wasm32", inline(never))]
fn times(columns: &[[Lanes; LANES]], vector: &[Lanes]) -> Lanes {
    let [mut a, mut b, mut c, mut d] = [[0.0; LANES]; LANES];
    for (columns, vector) in columns.iter().zip(vector) {
        a = add_product(a, columns[0], [vector[0]; LANES]);
        b = add_product(b, columns[1], [vector[1]; LANES]);
        c = add_product(c, columns[2], [vector[2]; LANES]);
        d = add_product(d, columns[3], [vector[3]; LANES]);
    }
    std::array::from_fn(|i| (a[i] + b[i]) + (c[i] + d[i]))
}

#[inline(always)]
fn add_product(sum: Lanes, a: Lanes, b: Lanes) -> Lanes {
    [sum[0] + a[0] * b[0], sum[1] + a[1] * b[1], sum[2] + a[2] * b[2], sum[3] + a[3] * b[3]]
}

/// `C^T x = y` for the own rows of a front, where those below are known.
pub(super) fn backward(front: &[Lanes], own: usize, values: &mut [Lanes]) {
    let (above, below) = front.split_at(triangle(own));
    for block in (0..own).rev() {
        let (unknown, known) = values.split_at_mut(block + 1);
        let Some(value) = unknown.last_mut() else { return };
        let (inside, outside) = known.split_at(own - block - 1);
        let column = LANES * block;
        let rows = (block + 1..own).map(|strip| &above[triangle(strip) + column..]);
        let inside = transposed_times(rows, inside);
        let outside =
            transposed_times(below.chunks_exact(LANES * own).map(|row| &row[column..]), outside);
        let Some(corner) = above[triangle(block)..].as_chunks::<LANES>().0.get(block) else {
            return;
        };
        for j in (0..LANES).rev() {
            value[j] -= inside[j] + outside[j];
            for i in j + 1..LANES {
                value[j] -= corner[j][i] * value[i];
            }
            value[j] /= corner[j][j];
        }
    }
}

/// The products of the first four columns of some rows with a vector.
#[cfg_attr(target_arch = "wasm32", inline(never))]
fn transposed_times<'a>(rows: impl Iterator<Item = &'a [Lanes]>, vector: &[Lanes]) -> Lanes {
    let [mut a, mut b, mut c, mut d] = [[0.0; LANES]; LANES];
    for (columns, vector) in rows.zip(vector) {
        if let Some(columns) = columns.first_chunk::<LANES>() {
            a = add_product(a, columns[0], *vector);
            b = add_product(b, columns[1], *vector);
            c = add_product(c, columns[2], *vector);
            d = add_product(d, columns[3], *vector);
        }
    }
    [a, b, c, d].map(|sums| (sums[0] + sums[1]) + (sums[2] + sums[3]))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A positive definite matrix without structure.
    fn example(size: usize) -> Vec<Vec<f64>> {
        let value = |row: usize, column: usize| {
            (1.0 + (row * column) as f64 + 3.0 * (row + column) as f64).sin()
        };
        let mut matrix: Vec<Vec<f64>> =
            (0..size).map(|row| (0..size).map(|column| value(row, column)).collect()).collect();
        for (index, row) in matrix.iter_mut().enumerate() {
            row[index] += 2.0 * size as f64;
        }
        matrix
    }

    /// Every size of blocks: less than one, some, and one that is cut.
    #[test]
    fn fronts_are_eliminated_and_solved() {
        for (own, boundary) in
            [(0, 3), (1, 0), (3, 5), (BLOCK, 1), (BLOCK + 3, 2 * BLOCK + 1), (3 * BLOCK - 1, 2)]
        {
            let rows = own + boundary;
            let matrix = example(LANES * rows);
            let entry = |strip: usize, column: usize| {
                std::array::from_fn(|lane| matrix[LANES * strip + lane][column])
            };
            let mut front = Vec::new();
            for strip in 0..rows {
                assert_eq!(front.len(), trapezoid(own, strip));
                front.extend((0..LANES * (strip + 1).min(own)).map(|column| entry(strip, column)));
            }
            let mut left_over: Vec<Lanes> = Vec::new();
            for strip in own..rows {
                assert_eq!(left_over.len(), triangle(strip - own));
                left_over
                    .extend((LANES * own..LANES * (strip + 1)).map(|column| entry(strip, column)));
            }
            assert!(eliminate(&mut front, own, rows, &mut left_over));

            let factor = |row: usize, column: usize| match row / LANES {
                strip if column < LANES * (strip + 1).min(own) => {
                    front[trapezoid(own, strip) + column][row % LANES]
                }
                _ => 0.0,
            };
            for row in 0..LANES * rows {
                for column in 0..=row {
                    let product: f64 =
                        (0..LANES * own).map(|k| factor(row, k) * factor(column, k)).sum();
                    let rest = match column.checked_sub(LANES * own) {
                        Some(column) => {
                            left_over[triangle(row / LANES - own) + column][row % LANES]
                        }
                        None => 0.0,
                    };
                    assert!(
                        (product + rest - matrix[row][column]).abs() < 1e-11 * matrix.len() as f64
                    );
                }
            }

            // The factor, with the identity for what is not eliminated, times its transpose.
            let expected: Vec<f64> =
                (0..LANES * rows).map(|row| (0.3 * row as f64).cos()).collect();
            let whole = |row: usize, column: usize| match column < LANES * own {
                true => factor(row, column),
                false => f64::from(row == column),
            };
            let size = LANES * rows;
            let middle: Vec<f64> = (0..size)
                .map(|column| (0..size).map(|row| whole(row, column) * expected[row]).sum())
                .collect();
            let mut values = vec![[0.0; LANES]; rows];
            for (row, value) in values.as_flattened_mut().iter_mut().enumerate() {
                *value = (0..size).map(|column| whole(row, column) * middle[column]).sum();
            }
            forward(&front, own, &mut values);
            for (value, expected) in values.as_flattened().iter().zip(&middle) {
                assert!((value - expected).abs() < 1e-11, "{value} {expected}");
            }
            backward(&front, own, &mut values);
            for (value, expected) in values.as_flattened().iter().zip(&expected) {
                assert!((value - expected).abs() < 1e-11, "{value} {expected}");
            }
        }
    }
}
