//! Gives the shared library its soname. The list of what it exports is rustc's: a version script of every exported function, all
//! else hidden; a test holds it against `symbols.txt`.

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rustc-cdylib-link-arg=-Wl,-soname,libcatalyst.so.3");
}
