//! The exports of the module `kernel`: surfaces, edits and frames.

use crate::{KERNEL, lock, rehearsal};

/// Opens the surface of a message. Returns its number, 0 where there is none.
#[unsafe(no_mangle)]
pub extern "C" fn open_surface() -> u32 {
    lock(&KERNEL).open_surface()
}

/// Opens the surface of these arrays, one after the other, little endian: the coordinates of its
/// points (`3 * points` doubles), their mesh vertices (`points` 32-bit numbers, rising), the number
/// of points of each face (`faces`), their points (`corners`), the feature of each face (`faces`),
/// and the names of the features as a JSON list. Returns its number, 0 where it is none.
#[unsafe(no_mangle)]
pub extern "C" fn create_surface(points: usize, faces: usize, corners: usize) -> u32 {
    lock(&KERNEL).create_surface(points, faces, corners)
}

/// Forgets a surface and all that was set up for it.
#[unsafe(no_mangle)]
pub extern "C" fn close_surface(surface: u32) {
    lock(&KERNEL).close_surface(surface);
}

/// The points, triangles and features of a surface, to be drawn.
#[unsafe(no_mangle)]
pub extern "C" fn describe_surface(surface: u32) -> u32 {
    lock(&KERNEL).describe_surface(surface).into()
}

/// The displacement of each vertex of a surface that a stack of edits asks for.
#[unsafe(no_mangle)]
pub extern "C" fn displacement(surface: u32) -> u32 {
    lock(&KERNEL).displacement(surface).into()
}

/// The fault of the shape that the last [`displacement`] of a surface leads to, and the triangles
/// of all faces at fault.
#[unsafe(no_mangle)]
pub extern "C" fn check(surface: u32) -> u32 {
    lock(&KERNEL).check(surface).into()
}

/// The skeleton of a surface, extracted when it is first needed.
#[unsafe(no_mangle)]
pub extern "C" fn skeleton(surface: u32) -> u32 {
    lock(&KERNEL).skeleton(surface).into()
}

/// The header and the arrays of the next frame of a view, in single precision, as they are drawn;
/// tuple after tuple. What is known of a view is kept for its frames to come.
#[unsafe(no_mangle)]
pub extern "C" fn decode_frame() -> u32 {
    lock(&KERNEL).decode_frame().into()
}

/// Makes a small edit of its own, so that the engine compiles the kernel well before somebody waits
/// for it. Takes some 50 milliseconds and changes nothing; returns how many vertices it moved.
#[unsafe(no_mangle)]
pub extern "C" fn rehearse() -> usize {
    rehearsal::rehearse().iter().filter(|by| **by != [0.0; 3]).count()
}
