//! Gives the shared library its soname: that under which Catalyst looks for the implementation
//! `tombolo`.

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rustc-cdylib-link-arg=-Wl,-soname,libcatalyst-tombolo.so");
}
