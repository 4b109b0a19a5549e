//! The checks of a channel as a solver lends it.

use tombolo_deform::mesh::MeshError;

use super::{Association, Channel, FieldView};

/// A mistake in what a solver lends: it is to be mended in the solver.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ChannelError {
    /// Two channels bear one name.
    #[error("channel '{channel}' is given twice; expected channels of different names")]
    Twice {
        /// The name.
        channel: String,
    },
    /// The mesh is none.
    #[error("channel '{channel}': {source}")]
    Mesh {
        /// The channel.
        channel: String,
        /// The flaw.
        source: MeshError,
    },
    /// A field has another number of tuples than its mesh has vertices or cells.
    #[error(
        "channel '{channel}': field '{field}': found {found} tuples; expected {expected}, one for each {association}{}",
        match fits { Some(other) => format!("; found one for each {other}: is that its association?"), None => String::new() }
    )]
    FieldLength {
        /// The channel.
        channel: String,
        /// The field.
        field: String,
        /// The entities that it has one tuple for.
        association: Association,
        /// How many tuples it has.
        found: usize,
        /// How many it needs.
        expected: usize,
        /// The association that it would fit.
        fits: Option<Association>,
    },
}

/// Refuses two channels of one name.
///
/// # Errors
/// [`ChannelError::Twice`].
pub fn check_names(channels: &[Channel<'_>]) -> Result<(), ChannelError> {
    let is_known = |(index, channel): &(usize, &Channel<'_>)| {
        channels[..*index].iter().any(|other| other.name == channel.name)
    };
    match channels.iter().enumerate().find(is_known) {
        None => Ok(()),
        Some((_, channel)) => Err(ChannelError::Twice { channel: channel.name.into() }),
    }
}

impl Channel<'_> {
    /// Compares the lengths of all arrays, those of the fields among them. Looks at no value.
    ///
    /// # Errors
    /// [`ChannelError::Mesh`] or [`ChannelError::FieldLength`].
    pub fn check_lengths(&self) -> Result<(), ChannelError> {
        self.mesh.check_lengths().map_err(|source| self.mesh_error(source))?;
        self.fields.iter().try_for_each(|field| self.check_field(field))
    }

    /// Refuses cells that name vertices beyond the last, and coordinates that are not finite. One
    /// pass over the mesh.
    ///
    /// # Errors
    /// [`ChannelError::Mesh`].
    pub fn check_mesh(&self) -> Result<(), ChannelError> {
        self.mesh.validate().map_err(|source| self.mesh_error(source))
    }

    /// Refuses coordinates that are not finite. One pass over them.
    ///
    /// # Errors
    /// [`ChannelError::Mesh`].
    pub fn check_points(&self) -> Result<(), ChannelError> {
        self.mesh.points.check_finite().map_err(|source| self.mesh_error(source))
    }

    fn mesh_error(&self, source: MeshError) -> ChannelError {
        ChannelError::Mesh { channel: self.name.into(), source }
    }

    fn check_field(&self, field: &FieldView<'_>) -> Result<(), ChannelError> {
        let counts = (self.mesh.points.len(), self.mesh.cells.len());
        check_field_length(self.name, (field.name, field.association), field.values.len(), counts)
    }
}

/// Refuses a field whose number of tuples is not that of the vertices or of the cells.
///
/// # Errors
/// [`ChannelError::FieldLength`].
pub fn check_field_length(
    channel: &str,
    (field, association): (&str, Association),
    found: usize,
    (vertices, cells): (usize, usize),
) -> Result<(), ChannelError> {
    let (expected, fitting, other) = match association {
        Association::Vertex => (vertices, cells, Association::Element),
        Association::Element => (cells, vertices, Association::Vertex),
        Association::Mesh => return Ok(()),
    };
    if found == expected {
        return Ok(());
    }
    Err(ChannelError::FieldLength {
        channel: channel.into(),
        field: field.into(),
        association,
        found,
        expected,
        fits: (found == fitting).then_some(other),
    })
}
