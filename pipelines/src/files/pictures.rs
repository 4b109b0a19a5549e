//! Pictures as PNG files, and Cinema databases of them.

use std::fs::File;
use std::io::{BufRead as _, BufReader, BufWriter, ErrorKind, Read as _, Write as _};
use std::path::{Path, PathBuf};

use super::error::{FileError, Flaw};
use super::whole::{write_longer, write_whole};
use crate::render::{Image, Picture};

/// Writes a picture to a PNG file of 8 bits a channel.
///
/// # Errors
/// [`FileError`] where the file cannot be written.
pub fn write_picture(path: impl AsRef<Path>, image: &Image) -> Result<(), FileError> {
    let path = path.as_ref();
    let bytes = encode(image).map_err(|error| Flaw::from(error).in_file(path))?;
    write_whole(path, |file| file.write_all(&bytes))
}

/// The picture as the bytes of a PNG file.
fn encode(image: &Image) -> std::io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, image.width, image.height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    let mut writer = encoder.write_header().map_err(std::io::Error::other)?;
    writer.write_image_data(&image.pixels).map_err(std::io::Error::other)?;
    writer.finish().map_err(std::io::Error::other)?;
    Ok(bytes)
}

const TABLE: &str = "data.csv";
const HEAD: &str = "time,cycle,camera,azimuth,elevation,FILE\n";
/// Bytes of a table that are read back.
const MOST: u64 = 1 << 30;

/// A Cinema database (specification D): a folder that ends in `.cdb` with pictures and the table
/// `data.csv`, which says what each of them shows.
///
/// Whenever a run is killed, the table is whole, and names only pictures that are there.
///
/// ```no_run
/// # use std::path::Path;
/// # use tombolo_pipelines::{files::{Database, FileError}, render::Picture};
/// # fn add(picture: &Picture) -> Result<(), FileError> {
/// let mut database = Database::create(Path::new("out/nozzle.cdb"))?;
/// database.push(10, 0.01, picture)?;
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct Database {
    folder: PathBuf,
    /// Bytes of the table.
    length: u64,
}

impl Database {
    /// A database without pictures. The table of one that was there is replaced.
    ///
    /// # Errors
    /// [`FileError`] where the table cannot be written.
    pub fn create(folder: &Path) -> Result<Self, FileError> {
        write_whole(&folder.join(TABLE), |file| file.write_all(HEAD.as_bytes()))?;
        Ok(Self { folder: folder.to_path_buf(), length: HEAD.len() as u64 })
    }

    /// Goes on with the database that is there, or creates it. Pictures of later cycles than this
    /// leave the table.
    ///
    /// # Errors
    /// [`FileError`] where the table cannot be read or written.
    pub fn resume(folder: &Path, cycle: u64) -> Result<Self, FileError> {
        let table = folder.join(TABLE);
        let old = match File::open(&table) {
            Ok(old) => old,
            Err(error) if error.kind() == ErrorKind::NotFound => return Self::create(folder),
            Err(error) => return Err(Flaw::from(error).in_file(&table)),
        };
        let mut lines = BufReader::new(old.take(MOST)).lines().map_while(Result::ok);
        if lines.next().is_none_or(|line| line != HEAD.trim_end()) {
            return Self::create(folder);
        }
        let of_row = |row: &String| row.split(',').nth(1)?.parse().ok();
        let mut length = HEAD.len() as u64;
        write_whole(&table, |file| {
            let mut out = BufWriter::new(file);
            out.write_all(HEAD.as_bytes())?;
            for row in lines.filter(|row| of_row(row).is_some_and(|of: u64| of <= cycle)) {
                writeln!(out, "{row}")?;
                length += row.len() as u64 + 1;
            }
            out.flush()
        })?;
        Ok(Self { folder: folder.to_path_buf(), length })
    }

    /// Writes a picture and adds its row to the table. Of a camera that stands at a point the
    /// angles are left empty.
    ///
    /// # Errors
    /// [`FileError`] where either cannot be written.
    pub fn push(&mut self, cycle: u64, time: f64, picture: &Picture) -> Result<(), FileError> {
        let Picture { camera, angles, image, .. } = picture;
        let name = format!("{cycle:06}-{camera}.png");
        write_picture(self.folder.join(&name), image)?;
        let [azimuth, elevation] =
            angles.map_or([String::new(), String::new()], |them| them.map(|it| it.to_string()));
        let row = format!("{time},{cycle},{camera},{azimuth},{elevation},{name}\n");
        let table = self.folder.join(TABLE);
        write_longer(&table, self.length, &row, "")?;
        self.length += row.len() as u64;
        Ok(())
    }
}
