//! Draws the pictures that a configuration asks for, of a mesh file with the fields that it has.
//!
//! cargo run --release -p tombolo-pipelines --example draw -- out/final.vtu pictures.json FOLDER

use std::collections::HashMap;
use std::error::Error;
use std::path::Path;

use tombolo_deform::mesh::{ArrayView, MeshView, Values};
use tombolo_pipelines::extract::{Channel, FieldView, Snapshot};
use tombolo_pipelines::files::{Database, read_mesh, write_picture};
use tombolo_pipelines::language::parse;
use tombolo_pipelines::run::{Output, Runner};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [mesh, configuration, folder] = arguments.as_slice() else {
        return Err("expected a mesh, a configuration and a folder".into());
    };
    let file = read_mesh(Path::new(mesh))?;
    let mut fields = Vec::new();
    for field in &file.fields {
        let values = ArrayView::interleaved(Values::F64(&field.values), field.components)?;
        fields.push(FieldView { name: &field.name, association: field.association, values });
    }
    let config = parse(&std::fs::read_to_string(configuration)?, configuration)?;
    let mut runner = Runner::new(&config)?;
    let mut databases = HashMap::new();
    let channels = [Channel::new("file", MeshView::from(&file.mesh), &fields)];
    for output in runner.run(&Snapshot { cycle: 0, time: 0.0, channels: &channels }) {
        match output {
            Output::Picture { path, cycle, time, picture, .. } => {
                let path = Path::new(folder).join(path);
                match path.extension() {
                    Some(extension) if extension == "cdb" => {
                        let database = match databases.remove(&path) {
                            Some(database) => database,
                            None => Database::create(&path)?,
                        };
                        let database: &mut Database = databases.entry(path).or_insert(database);
                        database.push(cycle, time, &picture)?;
                    }
                    _ => write_picture(&path, &picture.image)?,
                }
            }
            Output::Error { message, .. } => eprintln!("{message}"),
            _ => {}
        }
    }
    Ok(())
}
