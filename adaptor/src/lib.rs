//! In situ adaptor: watch a running simulation in a browser and change the shape of its domain while it runs.
