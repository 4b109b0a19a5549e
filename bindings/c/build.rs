//! Gives the shared library its soname: it is `libtombolo.so` for those who link to it.

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rustc-cdylib-link-arg=-Wl,-soname,libtombolo.so.0");
}
