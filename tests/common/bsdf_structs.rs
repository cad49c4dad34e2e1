//! The structs of the kernels `glsl/kernels/test_bsdf_*.comp`.

neubrdf::shared_structs! {
    pub const BSDF_TEST_STRUCTS;

    #[derive(Default)]
    pub struct BsdfTestCase {
        pub wo: [f32; 3],
        pub material: u32,
        pub wi: [f32; 3],
        pub pad: u32,
        pub u: [f32; 3],
        pub pad_2: u32,
    }

    pub struct BsdfTestResult {
        pub eval_pdf: [f32; 4],
        pub wi: [f32; 3],
        pub pdf: f32,
        pub weight: [f32; 3],
        pub is_delta: u32,
    }

    pub struct BsdfTestPush {
        pub materials: u64,
        pub cases: u64,
        pub results: u64,
        pub count: u32,
        pub pad: u32,
    }
}
