//! Gives the library the name that programs remember it by (SONAME), so that a later one does not take its place unseen.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rustc-cdylib-link-arg=-Wl,-soname,libtrued_client.so.1");
    // What the libraries inside export is nobody's business.
    println!("cargo::rustc-cdylib-link-arg=-Wl,--exclude-libs,ALL");
    // Its thread outlives a `dlclose`: the code stays where it is.
    println!("cargo::rustc-cdylib-link-arg=-Wl,-z,nodelete");
}
