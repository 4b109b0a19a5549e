//! The bits by which VTK says that cells are ghosts or hidden (`vtkGhostType`).

/// The cell is a copy of one that another rank has.
pub const DUPLICATE: u8 = 1;
/// Finer cells lie over the cell.
pub const REFINED: u8 = 8;
/// The cell is not to be seen.
pub const HIDDEN: u8 = 32;

/// Whether a cell with these bits is there, as a cell of this rank or as a copy. One that is hidden
/// or refined is in no extract, no measure and no shape; its neighbours' faces against it are
/// boundary.
#[must_use]
pub const fn is_visible(bits: u8) -> bool {
    bits & (HIDDEN | REFINED) == 0
}

/// Whether a cell with these bits is this rank's own: visible, and no copy.
#[must_use]
pub const fn is_own(bits: u8) -> bool {
    is_visible(bits) && bits & DUPLICATE == 0
}

/// The bits of a `vtkGhostType` that is kept as another integer.
#[must_use]
pub const fn of_integer(bits: i64) -> u8 {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "the lowest eight bits are meant"
    )]
    {
        bits as u8
    }
}
