//! `tombolo check`.

use std::{path::PathBuf, str::FromStr, sync::Arc};

use crate::{
    deform::mesh::{ArrayView, MeshView, NumberType, Values},
    pipelines::{
        extract::{Association, Channel, Field, FieldView},
        files::read_mesh,
        language::{Content, LanguageErrors, ReadError, Trial, check_content, read_orders_text},
        run::MeshTrial,
    },
};
use clap::Args;

use super::{Failure, features::surface, json, say};

pub(crate) const EXIT_CODES: &str = "Exit codes: 0 all is well; 1 there are errors, or a file could not be read.

Each error is told once, in the order of the file; what would follow from another alone is not. Where a text is not JSON, that is \
its only error (of a file with a command in each line: of that line). Of more than a hundred errors the number is told.";

#[derive(Debug, Args)]
pub(crate) struct Options {
    /// A configuration, a file of orders (a list, a single one or the lines of a journal), or a list
    /// of edits
    file: PathBuf,
    /// Try it on a mesh as well, as at the first step of a run: .vtu, .vtk, .vtp or .msh. Fields and
    /// features are then looked up, and nothing is written
    #[arg(long, value_name = "MESH")]
    mesh: Option<PathBuf>,
    /// Take the mesh for the one of this channel alone; left out, it stands for every channel
    #[arg(long, requires = "mesh")]
    channel: Option<String>,
    /// A field that the solver adds to those of the mesh, by its name, and at will its components and
    /// `element`: `pressure`, `velocity:3`, `speed:1:element`
    #[arg(long = "field", value_name = "NAME[:COMPONENTS[:element]]", requires = "mesh")]
    fields: Vec<Declared>,
    /// Name the parts between edges of this many degrees or more feature-1, feature-2, ...; see
    /// `tombolo features`
    #[arg(long, value_name = "DEGREES", requires = "mesh", allow_negative_numbers = true)]
    angle: Option<f64>,
    /// Print the errors as one JSON array: objects with `file`, `line`, `column`, `path`, `message`
    /// and `suggestion`
    #[arg(long)]
    json: bool,
}

/// A field that a solver has.
#[derive(Debug, Clone)]
struct Declared {
    name: String,
    components: usize,
    association: Association,
}

impl FromStr for Declared {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut parts = text.split(':');
        let name = parts.next().unwrap_or_default().to_owned();
        let components = match parts.next().map(str::parse) {
            None => 1,
            Some(Ok(components @ 1..=9)) => components,
            Some(_) => return Err("expected 1 to 9 components behind the name".into()),
        };
        let association = match parts.next() {
            None | Some("vertex") => Association::Vertex,
            Some("element") => Association::Element,
            Some(_) => return Err("expected `vertex` or `element` behind the components".into()),
        };
        match parts.next() {
            None if !name.is_empty() => Ok(Self { name, components, association }),
            _ => Err("expected a name, and at will its components and association".into()),
        }
    }
}

pub(crate) fn check(options: &Options) -> Result<(), Failure> {
    let name = options.file.display().to_string();
    match checked(options, &name) {
        Ok(Ok(_)) if options.json => json(&[(); 0]),
        Ok(Ok(content)) => say(format_args!("{name}: {}, all well", describe(&content))),
        Ok(Err(errors)) => tell(&errors, options.json),
        Err(Failure::Wrong(message)) if options.json => {
            json(&[serde_json::json!({"file": name, "message": message})])?;
            Err(Failure::Reported)
        }
        Err(failure) => Err(failure),
    }
}

/// The content of the file, or every error in it.
///
/// # Errors
/// Where a file could not be read.
fn checked(options: &Options, name: &str) -> Result<Result<Content, LanguageErrors>, Failure> {
    let text = match read_orders_text(&options.file) {
        Err(ReadError::Text(errors)) => return Ok(Err(errors)),
        text => text?,
    };
    Ok(match &options.mesh {
        None => check_content(&text, name, None),
        Some(mesh) => {
            let file = read_mesh(mesh)?;
            let surface = Arc::new(surface(&file.mesh, options.angle)?);
            let counts = (file.mesh.points().len(), file.mesh.cells().len());
            let declared = options.fields.iter().map(|declared| declared.zeros(counts));
            let fields: Vec<Field> = file.fields.iter().cloned().chain(declared).collect();
            let views: Vec<FieldView> = fields.iter().filter_map(view).collect();
            let channel = options.channel.as_deref().unwrap_or("mesh");
            let channel = Channel::new(channel, MeshView::from(&file.mesh), &views);
            let mut trial = MeshTrial::new(channel, surface);
            if let Some(channel) = &options.channel {
                trial = trial.of_channel(channel);
            }
            let trial: &mut dyn Trial = &mut trial;
            check_content(&text, name, Some(trial))
        }
    })
}

impl Declared {
    /// The field with no value but 0.
    fn zeros(&self, (vertices, cells): (usize, usize)) -> Field {
        let Self { name, components, association } = self.clone();
        let count = if association == Association::Element { cells } else { vertices };
        let values = vec![0.0; components * count];
        Field { name, association, components, number: NumberType::F64, values }
    }
}

fn view(field: &Field) -> Option<FieldView<'_>> {
    let values = ArrayView::interleaved(Values::F64(&field.values), field.components).ok()?;
    Some(FieldView { name: &field.name, association: field.association, values })
}

fn describe(content: &Content) -> String {
    match content {
        Content::Configuration(config) => format!("{} pipeline(s)", config.pipelines.len()),
        Content::Orders(orders) => format!("{} command(s)", orders.len()),
        Content::Order(order) => format!("an order of {} edit(s)", order.edits().len()),
        Content::Edits(edits) => format!("{} edit(s)", edits.len()),
    }
}

fn tell(errors: &LanguageErrors, as_json: bool) -> Result<(), Failure> {
    if as_json {
        json(&errors.iter().collect::<Vec<_>>())?;
        if errors.more() > 0 {
            eprintln!("tombolo: and {} more", errors.more());
        }
    } else {
        eprintln!("{errors}");
        eprintln!("tombolo: {} error(s)", errors.count());
    }
    Err(Failure::Reported)
}
