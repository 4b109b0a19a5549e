//! A picture in memory, and as a file.

/// A picture of 8 bits for each of red, green and blue.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Image {
    /// Pixels in each row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Red, green and blue of each pixel, row by row from the top left.
    pub pixels: Vec<u8>,
}

impl Image {
    pub(super) fn new(width: u32, height: u32, color: [u8; 3]) -> Self {
        let count = width as usize * height as usize;
        Self { width, height, pixels: color.repeat(count) }
    }

    /// The colour of a pixel, counted from the top left; `None` outside of the picture.
    #[must_use]
    pub fn pixel(&self, column: u32, row: u32) -> Option<[u8; 3]> {
        let at = (column < self.width && row < self.height)
            .then_some((row as usize * self.width as usize + column as usize) * 3)?;
        self.pixels.get(at..at + 3)?.try_into().ok()
    }

    pub(super) fn set(&mut self, pixel: usize, color: [u8; 3]) {
        if let Some(slot) = self.pixels.get_mut(pixel * 3..pixel * 3 + 3) {
            slot.copy_from_slice(&color);
        }
    }

    /// Lays a colour over a pixel, covering this many 4096ths of it. What lies outside of the
    /// picture is passed over.
    pub(super) fn cover(&mut self, column: i64, row: i64, color: [u8; 3], part: u32) {
        let inside = |at: i64, end: u32| usize::try_from(at).ok().filter(|&at| at < end as usize);
        let (Some(column), Some(row)) = (inside(column, self.width), inside(row, self.height))
        else {
            return;
        };
        let at = (row * self.width as usize + column) * 3;
        let part = part.min(4096);
        for (slot, channel) in self.pixels[at..at + 3].iter_mut().zip(color) {
            let mixed = u32::from(*slot) * (4096 - part) + u32::from(channel) * part;
            #[expect(clippy::cast_possible_truncation, reason = "a mean of bytes")]
            {
                *slot = ((mixed + 2048) / 4096) as u8;
            }
        }
    }

    /// Fills a rectangle.
    pub(super) fn fill(
        &mut self,
        columns: std::ops::Range<i64>,
        rows: std::ops::Range<i64>,
        color: [u8; 3],
    ) {
        for row in rows {
            for column in columns.clone() {
                self.cover(column, row, color, 4096);
            }
        }
    }
}
