//! Makes the gRPC types of `proto/render.proto`, if the crate is built as a service.

fn main() -> std::io::Result<()> {
    #[cfg(feature = "service")]
    tonic_prost_build::configure()
        .bytes(".fluxglobe.render.v1.DrawReply.png")
        .compile_protos(&["proto/render.proto"], &["proto"])?;
    Ok(())
}
