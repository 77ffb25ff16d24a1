//! Makes the gRPC types of `proto/render.proto`.

fn main() -> std::io::Result<()> {
    tonic_prost_build::configure()
        .bytes(".fluxglobe.render.v1.DrawReply.picture")
        .compile_protos(&["proto/render.proto"], &["proto"])
}
