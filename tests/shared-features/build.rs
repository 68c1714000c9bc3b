//! Nothing is to be done: dependencies of a build are those of a script.

fn main() {}
