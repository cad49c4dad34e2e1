//! The structs of the kernels `glsl/kernels/gpu_test_*.comp`.

neubrdf::shared_structs! {
    pub const GPU_TEST_STRUCTS;

    pub struct GpuTestFillPush {
        pub words: u64,
        pub count: u32,
        pub pad: u32,
    }

    pub struct GpuTestCounters {
        pub invocations: u32,
        pub groups: [u32; 3],
    }

    pub struct GpuTestCountPush {
        pub counters: u64,
        pub next_groups: u32,
        pub pad: u32,
    }

    pub struct GpuTestNode {
        pub next: u64,
        pub value: u32,
        pub is_last: u32,
    }

    pub struct GpuTestChasePush {
        pub first: u64,
        pub sum: u64,
    }

    pub struct GpuTestRay {
        pub origin: [f32; 3],
        pub t_max: f32,
        pub direction: [f32; 3],
        pub mask: u32,
    }

    #[derive(PartialEq)]
    pub struct GpuTestHit {
        pub custom_index: u32,
        pub geometry: u32,
        pub triangle: u32,
        pub t: f32,
    }

    pub struct GpuTestRayQueryPush {
        pub rays: u64,
        pub hits: u64,
        pub count: u32,
        pub pad: u32,
    }
}
