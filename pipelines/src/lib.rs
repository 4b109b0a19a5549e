//! The JSON language of Tombolo and its stages: extract, edit, deform, monitor, encode, write.
