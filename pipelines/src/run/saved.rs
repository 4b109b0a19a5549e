//! What pipelines have come to, so that a run that is restarted goes on from there.

use tombolo_deform::communicator::{Garbled, Reader, Writer};

use super::Runner;

impl Runner {
    /// Writes down what the pipelines have come to: when each has run last and what its condition
    /// was, what its monitors have measured, and what it follows over time.
    pub fn save(&self, writer: &mut Writer) {
        writer.u64(self.pipelines.len() as u64);
        for prepared in &self.pipelines {
            let mut own = Writer::default();
            prepared.save(&mut own);
            if let Some(history) = self.board.histories.get(prepared.index) {
                history.save(&mut own);
            }
            writer.text(&written(prepared));
            writer.bytes(&own.into_bytes());
        }
    }

    /// Goes on from what [`Runner::save`] wrote. A pipeline that is not what it was starts anew.
    ///
    /// # Errors
    /// [`Garbled`] where it was not written by that.
    pub fn restore(&mut self, reader: &mut Reader<'_>) -> Result<(), Garbled> {
        for _ in 0..reader.count(16)? {
            let (name, own) = (reader.text()?, reader.bytes()?);
            let mut own = Reader::new(0, own);
            let Some(prepared) =
                self.pipelines.iter_mut().find(|prepared| written(prepared) == name)
            else {
                continue;
            };
            prepared.restore(&mut own)?;
            if let Some(history) = self.board.histories.get_mut(prepared.index) {
                history.restore(&mut own)?;
            }
        }
        Ok(())
    }
}

/// A pipeline as it is written in JSON.
fn written(prepared: &super::pipeline::Prepared) -> String {
    serde_json::to_string(&prepared.pipeline).unwrap_or_default()
}
