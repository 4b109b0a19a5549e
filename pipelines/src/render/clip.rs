//! What lies before the camera: polygons and lines without the rest.

use super::camera::{Seen, View};
use super::raster::Corner;

/// The part of a polygon that is seen; all of it where nothing is beyond.
pub(super) fn polygon(view: &View, size: [f64; 2], corners: &mut Vec<Corner>) {
    for plane in 0..5 {
        let margin = |corner: &Corner| view.margins(corner.seen, size)[plane];
        if corners.iter().all(|corner| margin(corner) >= 0.0) {
            continue;
        }
        let mut kept = Vec::with_capacity(corners.len() + 1);
        for (index, corner) in corners.iter().enumerate() {
            let next = &corners[(index + 1) % corners.len()];
            let (here, there) = (margin(corner), margin(next));
            if here >= 0.0 {
                kept.push(*corner);
            }
            if (here >= 0.0) != (there >= 0.0) {
                let between = between(corner, next, here / (here - there));
                // The line along the plane is no edge of the face.
                let is_edge = here < 0.0 && corner.is_edge;
                kept.push(Corner { is_edge, ..between });
            }
        }
        *corners = kept;
    }
}

/// The part of a line that is seen; `None` where none is.
pub(super) fn line(view: &View, size: [f64; 2], mut ends: [Corner; 2]) -> Option<[Corner; 2]> {
    for plane in 0..5 {
        let [a, b] = [0, 1].map(|end| view.margins(ends[end].seen, size)[plane]);
        match (a >= 0.0, b >= 0.0) {
            (true, true) => {}
            (false, false) => return None,
            (true, false) => ends[1] = between(&ends[0], &ends[1], a / (a - b)),
            (false, true) => ends[0] = between(&ends[0], &ends[1], a / (a - b)),
        }
    }
    Some(ends)
}

fn between(from: &Corner, to: &Corner, part: f64) -> Corner {
    let mean = |a: f64, b: f64| a * (1.0 - part) + b * part;
    let (a, b) = (from.seen, to.seen);
    Corner {
        seen: Seen { x: mean(a.x, b.x), y: mean(a.y, b.y), distance: mean(a.distance, b.distance) },
        value: mean(from.value, to.value),
        light: mean(from.light, to.light),
        is_edge: false,
    }
}
