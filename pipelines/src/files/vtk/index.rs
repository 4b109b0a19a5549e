//! Files that name the file which holds the data, as programs want it that expect one file from
//! each rank.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use quick_xml::escape::escape;

use super::FEATURES;
use super::array::number_name;
use crate::extract::{Association, Extract};

/// A kind of such a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in super::super) enum Index {
    /// `.vtpd`: a partitioned dataset.
    Partitioned,
    /// `.pvtu`: an unstructured grid in pieces.
    Grid,
    /// `.pvtp`: polygonal data in pieces.
    Polygonal,
}

impl Index {
    /// The kind of files that end like this, if they are of one.
    pub(in super::super) fn of(extension: &str) -> Option<Self> {
        match extension {
            "vtpd" => Some(Self::Partitioned),
            "pvtu" => Some(Self::Grid),
            "pvtp" => Some(Self::Polygonal),
            _ => None,
        }
    }

    /// Where the data lies, relative to the folder of the file itself: what VTK calls it, in a
    /// folder of the file's name.
    pub(in super::super) fn piece(self, path: &Path) -> PathBuf {
        let stem =
            path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
        let extension = if self == Self::Polygonal { "vtp" } else { "vtu" };
        Path::new(&stem).join(format!("{stem}_0.{extension}"))
    }

    /// The text of the index of one piece, which holds `extract`.
    pub(in super::super) fn text(self, piece: &Path, extract: &Extract) -> String {
        let piece = piece.to_string_lossy();
        let piece = escape(piece.as_ref());
        let kind = match self {
            Self::Partitioned => "vtkPartitionedDataSet",
            Self::Grid => "PUnstructuredGrid",
            Self::Polygonal => "PPolyData",
        };
        let mut text = format!(
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"{kind}\" version=\"1.0\" byte_order=\"LittleEndian\" \
             header_type=\"UInt64\">\n"
        );
        if self == Self::Partitioned {
            let _ = write!(
                text,
                "<{kind}>\n<DataSet index=\"0\" file=\"{piece}\"/>\n</{kind}>\n</VTKFile>\n"
            );
            return text;
        }
        let _ = writeln!(text, "<{kind} GhostLevel=\"0\">");
        let arrays = |association: Association| {
            let mut arrays = String::new();
            if association == Association::Element && extract.features.is_some() {
                let _ = writeln!(
                    arrays,
                    "<PDataArray type=\"Int64\" Name=\"{FEATURES}\" NumberOfComponents=\"1\"/>"
                );
            }
            for field in extract.fields.iter().filter(|field| field.association == association) {
                let (name, components, kind) =
                    (escape(field.name.as_str()), field.components, number_name(field.number));
                let _ = writeln!(
                    arrays,
                    "<PDataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{components}\"/>"
                );
            }
            arrays
        };
        let (points, cells) = (arrays(Association::Vertex), arrays(Association::Element));
        let _ = write!(
            text,
            "<PPointData>\n{points}</PPointData>\n<PCellData>\n{cells}</PCellData>\n<PPoints>\n\
             <PDataArray type=\"Float64\" Name=\"Points\" NumberOfComponents=\"3\"/>\n</PPoints>\n\
             <Piece Source=\"{piece}\"/>\n</{kind}>\n</VTKFile>\n"
        );
        text
    }
}
