//! Colours of values.

use std::sync::LazyLock;

use serde::Deserialize;

use crate::language::ColorMap;

/// Into how many steps a map is divided.
const STEPS: usize = 1024;

/// The colours of values from 0 to 1.
pub(super) struct Palette(Vec<[u8; 3]>);

impl Palette {
    pub(super) fn new(map: ColorMap) -> Self {
        let knots = knots(map);
        let of_step = |step: usize| {
            // Between two knots in whole numbers, rounded to the nearest.
            let scaled = step * (knots.len() - 1);
            let (knot, part) = (scaled / STEPS, scaled % STEPS);
            let [low, high] = [knots[knot], knots[(knot + 1).min(knots.len() - 1)]];
            [0, 1, 2].map(|channel| {
                let sum =
                    usize::from(low[channel]) * (STEPS - part) + usize::from(high[channel]) * part;
                #[expect(clippy::cast_possible_truncation, reason = "a mean of bytes")]
                {
                    ((sum + STEPS / 2) / STEPS) as u8
                }
            })
        };
        Self((0..=STEPS).map(of_step).collect())
    }

    /// The colour of a value from 0 to 1.
    pub(super) fn color(&self, value: f64) -> [u8; 3] {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            clippy::cast_precision_loss,
            reason = "within the table"
        )]
        let step = (value * STEPS as f64 + 0.5) as usize;
        self.0[step.min(STEPS)]
    }
}

/// Colours at equal distances.
///
/// The list is the viewer's too. Viridis, plasma, inferno (S. van der Walt and N. Smith) and
/// twilight (B. Bechtold) are given to the public domain (CC0); cividis is by J. Nuñez, C.
/// Anderson and R. Renslow, "Optimizing colormaps with consideration for color vision deficiency",
/// PLOS ONE 13 (2018), for anyone to use; cool to warm is computed by the rule of K. Moreland,
/// "Diverging color maps for scientific visualization" (2009).
static MAPS: LazyLock<Vec<Described>> = LazyLock::new(|| {
    serde_json::from_str(include_str!("colour-maps.json")).expect("the list is part of the program")
});

#[derive(Deserialize)]
struct Described {
    name: ColorMap,
    /// Each `rrggbb`, at least two.
    colors: Vec<String>,
}

fn knots(map: ColorMap) -> Vec<[u8; 3]> {
    let described = MAPS.iter().filter(|described| described.name == map);
    described.flat_map(|described| &described.colors).map(|color| split(color)).collect()
}

fn split(color: &str) -> [u8; 3] {
    let [_, red, green, blue] = u32::from_str_radix(color, 16).unwrap_or_default().to_be_bytes();
    [red, green, blue]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_map_is_in_the_list_and_of_colours() {
        let maps = [
            ColorMap::Viridis,
            ColorMap::Cividis,
            ColorMap::Plasma,
            ColorMap::Inferno,
            ColorMap::CoolWarm,
            ColorMap::Twilight,
            ColorMap::Grey,
        ];
        assert_eq!(MAPS.iter().map(|map| map.name).collect::<Vec<_>>(), maps);
        for map in MAPS.iter() {
            assert!(map.colors.len() >= 2, "{:?}", map.name);
            let is_color =
                |color: &String| color.len() == 6 && u32::from_str_radix(color, 16).is_ok();
            assert!(map.colors.iter().all(is_color), "{:?}", map.name);
        }
        // What lies on one side of the range lies beside what is on the other.
        let cyclic = Palette::new(ColorMap::Twilight);
        assert_eq!(cyclic.color(0.0), cyclic.color(1.0));
    }

    #[test]
    fn ends_are_those_of_the_map_and_lightness_rises() {
        let palette = Palette::new(ColorMap::Viridis);
        assert_eq!(palette.color(0.0), [0x44, 0x01, 0x54]);
        assert_eq!(palette.color(1.0), [0xfd, 0xe7, 0x25]);
        let maps = [ColorMap::Viridis, ColorMap::Cividis, ColorMap::Plasma, ColorMap::Inferno];
        for map in maps.into_iter().chain([ColorMap::Grey]) {
            let palette = Palette::new(map);
            let lightness = |step: u32| {
                let [red, green, blue] = palette.color(f64::from(step) / 20.0).map(f64::from);
                0.2126 * red * red + 0.7152 * green * green + 0.0722 * blue * blue
            };
            assert!((0..20).all(|step| lightness(step) < lightness(step + 1)), "{map:?}");
        }
    }
}
