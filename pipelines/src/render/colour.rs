//! Colours of values.

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
            let [low, high] = [knot, (knot + 1).min(knots.len() - 1)].map(|at| split(knots[at]));
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

fn split(color: u32) -> [u8; 3] {
    let [_, red, green, blue] = color.to_be_bytes();
    [red, green, blue]
}

/// Colours at equal distances, as `0xrrggbb`.
///
/// Viridis, plasma and inferno are by S. van der Walt and N. Smith, given to the public domain
/// (CC0); cividis is by J. Nuñez, C. Anderson and R. Renslow, "Optimizing colormaps with
/// consideration for color vision deficiency", PLOS ONE 13 (2018), for anyone to use; cool to warm
/// is computed by the rule of K. Moreland, "Diverging color maps for scientific visualization"
/// (2009).
fn knots(map: ColorMap) -> &'static [u32] {
    match map {
        ColorMap::Viridis => &[
            0x440154, 0x46085c, 0x471063, 0x481769, 0x481d6f, 0x482475, 0x472a7a, 0x46307e,
            0x453781, 0x433d84, 0x414287, 0x3f4889, 0x3d4e8a, 0x3a538b, 0x38598c, 0x355e8d,
            0x33638d, 0x31688e, 0x2e6d8e, 0x2c718e, 0x2a768e, 0x297b8e, 0x27808e, 0x25848e,
            0x23898e, 0x218e8d, 0x20928c, 0x1f978b, 0x1e9c89, 0x1fa188, 0x21a585, 0x24aa83,
            0x28ae80, 0x2eb37c, 0x35b779, 0x3dbc74, 0x46c06f, 0x50c46a, 0x5ac864, 0x65cb5e,
            0x70cf57, 0x7cd250, 0x89d548, 0x95d840, 0xa2da37, 0xb0dd2f, 0xbddf26, 0xcae11f,
            0xd8e219, 0xe5e419, 0xf1e51d, 0xfde725,
        ],
        ColorMap::Cividis => &[
            0x00224e, 0x002656, 0x002a5f, 0x002d68, 0x003070, 0x083370, 0x163770, 0x203a6f,
            0x273e6e, 0x2e416d, 0x34456c, 0x3a486c, 0x3f4c6c, 0x444f6c, 0x49536c, 0x4e566c,
            0x535a6d, 0x575d6d, 0x5c616e, 0x60646f, 0x656870, 0x696b71, 0x6d6f72, 0x727274,
            0x767676, 0x7a7a78, 0x7e7d78, 0x838179, 0x888578, 0x8d8878, 0x928c78, 0x969077,
            0x9b9476, 0xa09875, 0xa59c74, 0xaaa073, 0xafa471, 0xb5a86f, 0xbaac6d, 0xbfb06b,
            0xc4b468, 0xc9b965, 0xcfbd62, 0xd4c15f, 0xdac65b, 0xdfca57, 0xe5cf52, 0xead34c,
            0xf0d846, 0xf6dd3f, 0xfce236, 0xfee838,
        ],
        ColorMap::Plasma => &[
            0x0d0887, 0x1b068d, 0x260591, 0x2f0596, 0x38049a, 0x41049d, 0x4903a0, 0x5102a3,
            0x5901a5, 0x6100a7, 0x6900a8, 0x7100a8, 0x7801a8, 0x8004a8, 0x8707a6, 0x8e0ca4,
            0x9511a1, 0x9c179e, 0xa21d9a, 0xa82296, 0xae2892, 0xb42e8d, 0xba3388, 0xbf3984,
            0xc43e7f, 0xc9447a, 0xcd4a76, 0xd24f71, 0xd6556d, 0xda5b69, 0xde6164, 0xe26660,
            0xe66c5c, 0xe97257, 0xed7953, 0xf07f4f, 0xf3854b, 0xf58c46, 0xf79342, 0xf99a3e,
            0xfba139, 0xfca835, 0xfdaf31, 0xfeb72d, 0xfebe2a, 0xfdc627, 0xfcce25, 0xfbd724,
            0xf8df25, 0xf6e826, 0xf3f027, 0xf0f921,
        ],
        ColorMap::Inferno => &[
            0x000004, 0x02020c, 0x050417, 0x0a0722, 0x10092d, 0x160b39, 0x1e0c45, 0x260c51,
            0x2f0a5b, 0x380962, 0x400a67, 0x490b6a, 0x510e6c, 0x59106e, 0x61136e, 0x69166e,
            0x71196e, 0x781c6d, 0x801f6c, 0x88226a, 0x902568, 0x982766, 0xa02a63, 0xa82e5f,
            0xb0315b, 0xb73557, 0xbf3952, 0xc63d4d, 0xcc4248, 0xd34743, 0xd94d3d, 0xdf5337,
            0xe45a31, 0xe9612b, 0xed6925, 0xf1711f, 0xf47918, 0xf78212, 0xf98b0b, 0xfa9407,
            0xfb9d07, 0xfca60c, 0xfcb014, 0xfbba1f, 0xfac42a, 0xf8cd37, 0xf6d746, 0xf4e156,
            0xf2ea69, 0xf2f27d, 0xf5f992, 0xfcffa4,
        ],
        ColorMap::CoolWarm => &[
            0x3b4cc0, 0x445acc, 0x4e68d8, 0x5775e1, 0x6282ea, 0x6c8ef1, 0x779af7, 0x82a5fb,
            0x8db0fe, 0x98b9ff, 0xa3c2ff, 0xaec9fd, 0xb8d0f9, 0xc2d5f4, 0xccd9ee, 0xd5dbe6,
            0xdddddd, 0xe5d8d1, 0xecd3c6, 0xf1ccb9, 0xf5c4ad, 0xf7bba0, 0xf7b194, 0xf7a687,
            0xf49a7b, 0xf18d6f, 0xec7f63, 0xe57058, 0xde614d, 0xd55042, 0xcb3e38, 0xc0282f,
            0xb40426,
        ],
        ColorMap::Grey => &[0x1a1a1a, 0xf2f2f2],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
