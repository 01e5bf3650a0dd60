# fathom: make help lists the targets.
# Objects go to $(BUILD); a second flavour is built beside it by giving another BUILD (and SANITIZE=address,undefined).

BUILD    ?= build
PREFIX   ?= /usr/local
UDEV     ?= $(PREFIX)/lib/udev/rules.d
SANITIZE ?=
DEBIAN_PACKAGES = gcc g++ libc6-dev pkg-config binutils ocl-icd-opencl-dev opencl-c-headers pocl-opencl-icd libeigen3-dev \
                  libpng-dev libopenni2-dev libhidapi-dev libusb-1.0-0-dev libiio-dev libcmocka-dev clang libclang-rt-dev \
                  oclgrind valgrind python3 python3-venv python3-numpy python3-matplotlib

# Drivers that stand on a library can be left out: make WITH_OPENNI2=0.
WITH_OPENNI2 ?= 1
WITH_HIDAPI  ?= 1
WITH_LIBUSB  ?= 1
WITH_LIBIIO  ?= 1
WITH_UDP     ?= 1

VERSION_MAJOR := $(shell sed -n 's/.define FATHOM_VERSION_MAJOR *//p' lib/fathom.h)
VERSION_MINOR := $(shell sed -n 's/.define FATHOM_VERSION_MINOR *//p' lib/fathom.h)
VERSION_PATCH := $(shell sed -n 's/.define FATHOM_VERSION_PATCH *//p' lib/fathom.h)
VERSION := $(VERSION_MAJOR).$(VERSION_MINOR).$(VERSION_PATCH)

ifdef SANITIZE
SAN_FLAGS = -fsanitize=$(SANITIZE) -fno-sanitize-recover=all -fno-omit-frame-pointer
endif
OPTIMISE ?= -O2 -g
WARN     = -Wall -Wextra -Wshadow -Wpointer-arith -Wvla
CPPFLAGS += -I. -Ilib -Idrivers -Iexamples -Itests -Itests/support -MMD -MP
ALL_CFLAGS   = -std=c11 -D_GNU_SOURCE $(OPTIMISE) $(WARN) -Wstrict-prototypes -Wmissing-prototypes -fPIC \
               -fvisibility=hidden -ffp-contract=off $(SAN_FLAGS) $(CFLAGS)
# Lines, not types: what debugging information says of Eigen is most of a library otherwise.
ALL_CXXFLAGS = -std=c++17 -D_GNU_SOURCE $(patsubst -g,-g1,$(OPTIMISE)) $(WARN) -fPIC -fvisibility=hidden -fvisibility-inlines-hidden \
               -ffp-contract=off -fno-exceptions -fno-rtti -fno-gnu-unique -DEIGEN_NO_MALLOC \
               $(shell pkg-config --cflags eigen3 2>/dev/null | sed 's/-I/-isystem /g') $(SAN_FLAGS) $(CXXFLAGS)
ALL_LDFLAGS  = $(SAN_FLAGS) $(LDFLAGS)

KERNELS_FIRST = opencl/layout.h opencl/common.cl opencl/blocks.cl
KERNELS     = $(KERNELS_FIRST) $(filter-out $(KERNELS_FIRST),$(sort $(wildcard opencl/*.cl)))
# Sources of a folder and of those in it.
sources_in  = $(sort $(foreach f,$(1),$(wildcard $(f)/*.c $(f)/*.cpp $(f)/*/*.c $(f)/*/*.cpp $(f)/*/*/*.c)))
LIB_OBJ     = $(patsubst %,$(BUILD)/%.o,$(call sources_in,lib)) $(BUILD)/kernels.o
DRIVERS_OUT = $(if $(filter 1,$(WITH_OPENNI2)),,drivers/camera/openni2_%.c) $(if $(filter 1,$(WITH_HIDAPI)),,drivers/imu/hid_source.c) \
              $(if $(filter 1,$(WITH_LIBUSB)),,drivers/imu/usb_%.c) $(if $(filter 1,$(WITH_LIBIIO)),,drivers/imu/iio_source.c) \
              $(if $(filter 1,$(WITH_UDP)),,drivers/imu/udp_source.c)
DRIVERS_WITH = $(foreach w,OPENNI2 HIDAPI LIBUSB LIBIIO UDP,-DFATHOM_WITH_$(w)=$(WITH_$(w)))
DRIVERS_OBJ = $(patsubst %,$(BUILD)/%.o,$(filter-out $(DRIVERS_OUT),$(call sources_in,drivers)))
CLI_OBJ     = $(patsubst %,$(BUILD)/%.o,$(call sources_in,examples/fathom examples/simulate examples/calibrate))
LIB_SO      = $(BUILD)/libfathom.so.$(VERSION)
DRIVERS_SO  = $(BUILD)/libfathom-drivers.so.$(VERSION)
DRIVERS_A   = $(BUILD)/libfathom-drivers.a
LIB_LIBS    = -lOpenCL -lpthread -lm
DRIVERS_PACKAGES = libpng $(if $(filter 1,$(WITH_OPENNI2)),libopenni2) $(if $(filter 1,$(WITH_HIDAPI)),hidapi-hidraw) \
                   $(if $(filter 1,$(WITH_LIBUSB)),libusb-1.0) $(if $(filter 1,$(WITH_LIBIIO)),libiio)
DRIVERS_LIBS = $(shell pkg-config --libs $(DRIVERS_PACKAGES) 2>/dev/null) -lpthread -lm

OBJCOPY ?= objcopy

# make V=1 shows the commands whole.
Q = $(if $(V),,@)
say = $(if $(V),,@printf '  %-4s %s\n' $(1) $@)

.PHONY: all programs deps demo check bench bench-scale instructions reproduce install uninstall clean help objects
.DELETE_ON_ERROR:

PARALLEL = $(if $(findstring -j,$(MAKEFLAGS)),,-j$(shell nproc))

# As many jobs as there are processors, unless -j says otherwise. Beside other goals it is `programs`: two makes would build the
# same objects.
all:
	@$(MAKE) --no-print-directory $(PARALLEL) programs

programs: deps-check $(BUILD)/libfathom.so $(BUILD)/libfathom.a $(BUILD)/libfathom-drivers.so $(DRIVERS_A) $(BUILD)/fathom $(BUILD)/minimal

.PHONY: deps-check
deps-check:
	@pkg-config --exists eigen3 OpenCL $(DRIVERS_PACKAGES) 2>/dev/null || { echo "make: one of eigen3 OpenCL $(DRIVERS_PACKAGES) is missing: run 'make deps' first" >&2; exit 1; }

$(BUILD)/%.c.o: %.c Makefile
	@mkdir -p $(@D)
	$(call say,CC)
	$(Q)$(CC) $(CPPFLAGS) $(ALL_CFLAGS) -c $< -o $@

$(BUILD)/%.cpp.o: %.cpp Makefile
	@mkdir -p $(@D)
	$(call say,CXX)
	$(Q)$(CXX) $(CPPFLAGS) $(ALL_CXXFLAGS) -c $< -o $@

# The table of drivers is made anew when another set of them is built.
$(BUILD)/drivers/source.c.o: ALL_CFLAGS += $(DRIVERS_WITH)
$(BUILD)/drivers/source.c.o: $(BUILD)/drivers/with
$(BUILD)/drivers/with: FORCE
	@mkdir -p $(@D)
	@echo '$(DRIVERS_WITH)' | cmp -s - $@ || echo '$(DRIVERS_WITH)' >$@
.PHONY: FORCE
FORCE:

$(BUILD)/drivers/imu/hid_source.c.o: CPPFLAGS += $(shell pkg-config --cflags hidapi-hidraw 2>/dev/null | sed 's/-I/-isystem /g')
$(BUILD)/drivers/imu/usb_%.c.o $(BUILD)/tests/unit/drivers/test_usb_%.c.o: CPPFLAGS += $(shell pkg-config --cflags libusb-1.0 2>/dev/null | sed 's/-I/-isystem /g')
$(BUILD)/drivers/camera/openni2_%.c.o: CPPFLAGS += $(shell pkg-config --cflags libopenni2 2>/dev/null | sed 's/-I/-isystem /g')

# The kernels' text, one C string a file, so that nothing has to be installed beside the library.
$(BUILD)/kernels.c: $(KERNELS) lib/cl/embed.sh
	@mkdir -p $(@D)
	$(call say,GEN)
	$(Q)sh lib/cl/embed.sh $(KERNELS) > $@

$(BUILD)/kernels.o: $(BUILD)/kernels.c
	$(call say,CC)
	$(Q)$(CC) $(CPPFLAGS) $(ALL_CFLAGS) -c $< -o $@

$(LIB_SO): $(LIB_OBJ)
	$(call say,LD)
	$(Q)$(CXX) -shared -Wl,-soname,libfathom.so.$(VERSION_MAJOR).$(VERSION_MINOR) -Wl,--no-undefined -o $@ $^ $(ALL_LDFLAGS) $(LIB_LIBS)

$(BUILD)/libfathom.so: $(LIB_SO)
	$(call say,LN)
	$(Q)ln -sf libfathom.so.$(VERSION) $(BUILD)/libfathom.so.$(VERSION_MAJOR).$(VERSION_MINOR)
	$(Q)ln -sf libfathom.so.$(VERSION_MAJOR).$(VERSION_MINOR) $@

# The drivers' own: it needs nothing of libfathom.so.
$(DRIVERS_SO): $(DRIVERS_OBJ)
	$(call say,LD)
	$(Q)$(CC) -shared -Wl,-soname,libfathom-drivers.so.$(VERSION_MAJOR).$(VERSION_MINOR) -Wl,--no-undefined -o $@ $^ $(ALL_LDFLAGS) $(DRIVERS_LIBS)

$(BUILD)/libfathom-drivers.so: $(DRIVERS_SO)
	$(call say,LN)
	$(Q)ln -sf libfathom-drivers.so.$(VERSION) $(BUILD)/libfathom-drivers.so.$(VERSION_MAJOR).$(VERSION_MINOR)
	$(Q)ln -sf libfathom-drivers.so.$(VERSION_MAJOR).$(VERSION_MINOR) $@

# An archive holds one object in which all hidden names are local, so that a caller's own step() or align() is neither
# taken for the library's nor in its way.
$(BUILD)/libfathom.a: $(LIB_OBJ)
$(DRIVERS_A): $(DRIVERS_OBJ)
$(BUILD)/libfathom.a $(DRIVERS_A):
	$(call say,AR)
	$(Q)rm -f $@
	$(Q)$(LD) -r --force-group-allocation -o $(@:.a=.o) $^
	$(Q)$(OBJCOPY) --localize-hidden $(@:.a=.o)
	$(Q)$(AR) rcs $@ $(@:.a=.o)

$(BUILD)/fathom: $(CLI_OBJ) $(DRIVERS_OBJ) $(LIB_OBJ)
	$(call say,LD)
	$(Q)$(CXX) -o $@ $^ $(ALL_LDFLAGS) $(DRIVERS_LIBS) $(LIB_LIBS)


# The README's program, as a user would link it.
$(BUILD)/minimal: $(BUILD)/examples/minimal.c.o $(BUILD)/libfathom.a
	$(call say,LD)
	$(Q)$(CXX) -o $@ $^ $(ALL_LDFLAGS) $(LIB_LIBS)

# ---- house ----------------------------------------------------------------------------------------------------------

help:
	@echo "make            build/fathom (the command), build/libfathom.so, .a, build/libfathom-drivers.so, .a"
	@echo "make deps       install the Debian packages that are missing"
	@echo "make demo       simulate a bare wall, scan it with and without the IMU; results in out/demo"
	@echo "make check      all tests; ends with 'N passed, N failed'"
	@echo "make fuzz       the parsers of device data under libFuzzer, ten minutes each (FUZZ_SECONDS=)"
	@echo "make mutants    careless changes in a copy: does a unit test see each? goes on where it stopped (MUTANTS='--count 240 --seed 1')"
	@echo "make check-vm   the drivers against the kernel's HID and USB in a virtual machine"
	@echo "make soak       a minute each of scanning and recording at full rate, by hand only (SOAK_SECONDS=)"
	@echo "make bench      speed beside other systems and the machine's limit (BENCH=--results: into docs/SPEED.md)"
	@echo "make bench-scale  time and memory as the work grows: depth, voxels, way, threads; into docs/SCALE.md"
	@echo "make instructions  count the stages' instructions into tests/bench/instructions.txt, which make check holds"
	@echo "make reproduce  the paper's claims as experiments, into docs/RESULTS.md (SECTIONS=a,d: only these)"
	@echo "make judge      accuracy over all recordings, within an hour, beside tests/judge/recorded (JUDGE='--only kitchen'; DATA=FOLDER)"
	@echo "make settings   docs/SETTINGS.md from the library's table of settings"
	@echo "make install    to PREFIX=$(PREFIX) (DESTDIR for packagers); make uninstall takes it away again"
	@echo "make clean      remove build/ and out/"

deps:
	@missing=""; for p in $(DEBIAN_PACKAGES); do \
	    dpkg-query -W -f '$${Status}' $$p 2>/dev/null | grep -q 'ok installed' || missing="$$missing $$p"; done; \
	if [ -z "$$missing" ]; then exit 0; fi; \
	command -v apt-get >/dev/null || { echo "make deps: no apt-get here; install the counterparts of:$$missing" >&2; exit 1; }; \
	if [ "$$(id -u)" = 0 ]; then as=""; elif command -v sudo >/dev/null && sudo -n true 2>/dev/null; then as="sudo"; \
	else echo "make deps: run this as root: apt-get install -y --no-install-recommends$$missing" >&2; exit 1; fi; \
	echo "make deps: installing$$missing"; \
	$$as apt-get update -q >/dev/null && DEBIAN_FRONTEND=noninteractive $$as apt-get install -y -q --no-install-recommends $$missing >/dev/null

# What is built after deps may need what deps has just installed, so it is a make of its own.
demo: deps
	@$(MAKE) --no-print-directory $(PARALLEL) programs
	sh examples/demo.sh $(BUILD)

# BENCH: further options of tests/bench/bench.py, e.g. --results, which writes docs/SPEED.md.
bench: deps
	@sh tests/bench/opencv.sh
	@$(MAKE) --no-print-directory programs bench-tools
	sh tests/bench/bench.sh $(BUILD) $(BENCH)

# SCALE: options of tests/bench/scale.py.
bench-scale: deps
	@$(MAKE) --no-print-directory all
	sh tests/bench/scale.sh $(BUILD) $(SCALE)

# The record that tests/e2e/instructions.sh holds stages to.
instructions: deps
	@$(MAKE) --no-print-directory all
	sh tests/bench/instructions.sh $(BUILD) --update

# SECTIONS: some of a to g, e.g. a,d; REPRODUCE: further options of tests/reproduce/reproduce.py.
SECTIONS ?= a,b,c,d,e,f,g
reproduce: deps
	@$(MAKE) --no-print-directory programs reproduce-tools
	sh tests/reproduce/reproduce.sh $(BUILD) --sections $(SECTIONS) $(REPRODUCE)

# A build over all recordings, beside the recorded table. DATA: a folder of recordings of one's own; JUDGE: further options of
# tests/judge/judge.py, e.g. --only kitchen, --record.
.PHONY: judge
judge: deps
	@$(MAKE) --no-print-directory $(PARALLEL) programs
	sh tests/judge/judge.sh $(BUILD) $(if $(DATA),--data '$(DATA)') $(JUDGE)

# The page of settings; make check holds it to the table.
.PHONY: settings
settings: all
	$(BUILD)/fathom info --settings --markdown > docs/SETTINGS.md

install: all
	install -d $(DESTDIR)$(PREFIX)/lib/pkgconfig $(DESTDIR)$(PREFIX)/include $(DESTDIR)$(PREFIX)/bin
	install -m 755 $(LIB_SO) $(DESTDIR)$(PREFIX)/lib/
	ln -sf libfathom.so.$(VERSION) $(DESTDIR)$(PREFIX)/lib/libfathom.so.$(VERSION_MAJOR).$(VERSION_MINOR)
	ln -sf libfathom.so.$(VERSION_MAJOR).$(VERSION_MINOR) $(DESTDIR)$(PREFIX)/lib/libfathom.so
	install -m 755 $(DRIVERS_SO) $(DESTDIR)$(PREFIX)/lib/
	ln -sf libfathom-drivers.so.$(VERSION) $(DESTDIR)$(PREFIX)/lib/libfathom-drivers.so.$(VERSION_MAJOR).$(VERSION_MINOR)
	ln -sf libfathom-drivers.so.$(VERSION_MAJOR).$(VERSION_MINOR) $(DESTDIR)$(PREFIX)/lib/libfathom-drivers.so
	install -m 644 $(BUILD)/libfathom.a $(DRIVERS_A) $(DESTDIR)$(PREFIX)/lib/
	install -m 644 lib/fathom.h drivers/fathom_drivers.h $(DESTDIR)$(PREFIX)/include/
	install -m 755 $(BUILD)/fathom $(DESTDIR)$(PREFIX)/bin/
	install -d $(DESTDIR)$(PREFIX)/share/man/man1 $(DESTDIR)$(PREFIX)/share/bash-completion/completions
	$(BUILD)/fathom --man > $(DESTDIR)$(PREFIX)/share/man/man1/fathom.1
	$(BUILD)/fathom --completion bash > $(DESTDIR)$(PREFIX)/share/bash-completion/completions/fathom
	sed -e 's|@PREFIX@|$(PREFIX)|' -e 's|@VERSION@|$(VERSION)|' lib/fathom.pc.in > $(DESTDIR)$(PREFIX)/lib/pkgconfig/fathom.pc
	sed -e 's|@PREFIX@|$(PREFIX)|' -e 's|@VERSION@|$(VERSION)|' -e 's|@LIBS@|$(DRIVERS_LIBS)|' drivers/fathom-drivers.pc.in \
	    > $(DESTDIR)$(PREFIX)/lib/pkgconfig/fathom-drivers.pc
	install -d $(DESTDIR)$(UDEV)
	install -m 644 drivers/udev/*.rules $(DESTDIR)$(UDEV)/

uninstall:
	rm -f $(DESTDIR)$(PREFIX)/lib/libfathom.so* $(DESTDIR)$(PREFIX)/lib/libfathom.a $(DESTDIR)$(PREFIX)/lib/libfathom-drivers.so* $(DESTDIR)$(PREFIX)/lib/libfathom-drivers.a
	rm -f $(DESTDIR)$(PREFIX)/include/fathom.h $(DESTDIR)$(PREFIX)/include/fathom_drivers.h
	rm -f $(DESTDIR)$(PREFIX)/bin/fathom $(DESTDIR)$(PREFIX)/lib/pkgconfig/fathom.pc $(DESTDIR)$(PREFIX)/lib/pkgconfig/fathom-drivers.pc
	rm -f $(DESTDIR)$(PREFIX)/share/man/man1/fathom.1 $(DESTDIR)$(PREFIX)/share/bash-completion/completions/fathom
	rm -f $(addprefix $(DESTDIR)$(UDEV)/,$(notdir $(wildcard drivers/udev/*.rules)))

clean:
	rm -rf build out

# Each fuzzer for ten minutes (FUZZ_SECONDS=); corpora stay in $(BUILD)/fuzz.
.PHONY: fuzz
FUZZ_SECONDS ?= 600
fuzz: deps
	sh tests/fuzz/run.sh $(BUILD) $(FUZZ_SECONDS)

# Careless changes, one at a time, in copies below $(BUILD)/mutants: the share that the unit tests see, and the survivors.
.PHONY: mutants
mutants: deps
	PYTHONDONTWRITEBYTECODE=1 python3 tests/mutants/mutants.py $(BUILD) $(MUTANTS)

# The drivers against the kernel's own HID and USB stacks, in a virtual machine.
.PHONY: check-vm
VM_PACKAGES = qemu-system-x86 busybox-static cpio kmod xz-utils
check-vm:
	@$(MAKE) --no-print-directory deps DEBIAN_PACKAGES='$(DEBIAN_PACKAGES) $(VM_PACKAGES)'
	@$(MAKE) --no-print-directory programs $(BUILD)/tests/vm/vm_drivers
	sh tests/vm/check.sh $(BUILD)

# Runs of minutes, that want a machine of their own; nothing of make check.
.PHONY: soak
SOAK_SECONDS ?= 60
soak: deps
	@$(MAKE) --no-print-directory programs $(if $(filter 1,$(WITH_OPENNI2)),$(VIRTUAL_DEPTH))
	sh tests/soak.sh $(BUILD) $(SOAK_SECONDS)

# ---- tests ----------------------------------------------------------------------------------------------------------
# tests/unit/*/test_*.c are cmocka programs, tests/e2e/*.sh end-to-end scripts; all print TAP, and tests/run.sh counts.

TESTS_OUT   = $(if $(filter 1,$(WITH_OPENNI2)),,test_openni2%) $(if $(filter 1,$(WITH_UDP)),,test_udp_source) \
              $(if $(filter 1,$(WITH_LIBUSB)),,test_usb_source) $(if $(filter 1,$(WITH_LIBIIO)),,test_iio_source)
TESTS_SRC   = $(sort $(wildcard tests/unit/*/test_*.c))
TESTS       = $(addprefix $(BUILD)/tests/,$(filter-out $(TESTS_OUT),$(notdir $(TESTS_SRC:.c=))))
SUPPORT_OBJ = $(patsubst %,$(BUILD)/%.o,$(wildcard tests/support/*.c))
CLI_PARTS   = $(filter-out $(BUILD)/examples/fathom/main.c.o,$(CLI_OBJ))
# Unit tests see the library's inside, so they link its objects: nothing but fathom_* leaves the archives.
INSIDE      = $(CLI_PARTS) $(DRIVERS_OBJ) $(LIB_OBJ)

$(BUILD)/tests/test_heap: $(BUILD)/tests/bench/heap_count.c.o
$(BUILD)/tests/test_heap: | $(BUILD)/libfathom.so

# OpenCL calls that a test makes fail.
SHIM = clCreateContext clCreateCommandQueue clCreateProgramWithSource clBuildProgram clCreateKernel clCreateBuffer clSetKernelArg \
       clEnqueueNDRangeKernel clEnqueueMapBuffer clEnqueueUnmapMemObject clEnqueueFillBuffer clFinish clFlush
$(BUILD)/tests/test_device_fails: $(BUILD)/tests/unit/cl/opencl_shim.c.o
$(BUILD)/tests/test_device_fails: ALL_LDFLAGS += $(SHIM:%=-Wl,--wrap=%)

define unit_test
$(BUILD)/tests/$(notdir $(1:.c=)): $(BUILD)/$(1).o $(SUPPORT_OBJ) $(INSIDE)
	$$(call say,LD)
	$$(Q)$$(CXX) -o $$@ $$(filter %.o,$$^) $$(ALL_LDFLAGS) -lcmocka $$(DRIVERS_LIBS) $$(LIB_LIBS)
endef
$(foreach t,$(TESTS_SRC),$(eval $(call unit_test,$(t))))

VM_OBJ = $(patsubst %,$(BUILD)/%.o,$(wildcard tests/vm/*.c))
$(BUILD)/tests/vm/vm_drivers: $(VM_OBJ) $(DRIVERS_OBJ) $(LIB_OBJ)
	$(call say,LD)
	$(Q)$(CXX) -o $@ $^ $(ALL_LDFLAGS) -lcmocka $(DRIVERS_LIBS) $(LIB_LIBS)

# Virtual cameras for test_openni2, as a driver that libOpenNI2 loads.
VIRTUAL_DEPTH = $(BUILD)/tests/openni2/libVirtualDepth.so.0
$(BUILD)/tests/openni2/%.cpp.o: CPPFLAGS += $(shell pkg-config --cflags libopenni2 2>/dev/null | sed 's/-I/-isystem /g')
$(BUILD)/tests/unit/drivers/test_openni2.c.o $(BUILD)/tests/unit/drivers/test_openni2_parts.c.o: CPPFLAGS += $(shell pkg-config --cflags libopenni2 2>/dev/null | sed 's/-I/-isystem /g')
# Only what it uses: libOpenNI2 loads it with every symbol resolved.
$(VIRTUAL_DEPTH): $(BUILD)/tests/openni2/virtual_depth.cpp.o $(filter $(addprefix $(BUILD)/drivers/recording/,recording% record_list% stray_scanner% image_file%),$(DRIVERS_OBJ))
	$(call say,LD)
	$(Q)$(CXX) -shared -o $@ $^ $(ALL_LDFLAGS) $(shell pkg-config --libs libpng 2>/dev/null) -lpthread -lm
$(BUILD)/tests/test_openni2: | $(VIRTUAL_DEPTH)

# What make reproduce measures with beside the fathom command.
$(BUILD)/tests/reproduce/%: $(BUILD)/tests/reproduce/%.c.o $(INSIDE)
	$(call say,LD)
	$(Q)$(CXX) -o $@ $^ $(ALL_LDFLAGS) $(DRIVERS_LIBS) $(LIB_LIBS)

# What make bench measures with beside it.
$(BUILD)/tests/bench/limit: $(addprefix $(BUILD)/tests/bench/,machine_limit.c.o stage_work.c.o bench_replay.c.o)
$(BUILD)/tests/bench/fusion: $(BUILD)/tests/bench/bench_replay.c.o
$(BUILD)/tests/bench/%: $(BUILD)/tests/bench/%.c.o $(INSIDE)
	$(call say,LD)
	$(Q)$(CXX) -o $@ $(filter %.o,$^) $(ALL_LDFLAGS) $(DRIVERS_LIBS) $(LIB_LIBS)

# A library that is an object of its own, so that its calls of the heap can be told from others'.
HEAP_PARTS = $(patsubst %,$(BUILD)/%.o,$(addprefix tests/bench/,heap.c heap_count.c bench_replay.c) \
             examples/fathom/replay/playback.c $(addprefix examples/fathom/shell/,settings.c set_option.c near_name.c options.c option_values.c help.c library.c cli.c log.c))
$(BUILD)/tests/bench/heap: $(HEAP_PARTS) $(DRIVERS_OBJ) $(BUILD)/libfathom.so
	$(call say,LD)
	$(Q)$(CXX) -o $@ $(HEAP_PARTS) $(DRIVERS_OBJ) -L$(BUILD) -lfathom -Wl,-rpath,'$$ORIGIN/../..' $(ALL_LDFLAGS) $(DRIVERS_LIBS)

$(BUILD)/tests/bench/libheap_count.so: $(BUILD)/tests/bench/heap_count.c.o
	$(call say,LD)
	$(Q)$(CC) -shared -o $@ $^ $(ALL_LDFLAGS)

# OpenCV's rgbd module, where it is installed.
$(BUILD)/tests/bench/odometry: tests/bench/odometry.cpp
	$(call say,CXX)
	$(Q)mkdir -p $(@D) && $(CXX) -std=c++17 $(OPTIMISE) $(WARN) -isystem /usr/include/opencv4 -o $@ $< -lopencv_rgbd -lopencv_imgcodecs -lopencv_core -ldl

.PHONY: reproduce-tools bench-tools
bench-tools: $(addprefix $(BUILD)/tests/bench/,limit fusion heap libheap_count.so)
	@if [ -e /usr/include/opencv4/opencv2/rgbd.hpp ]; then $(MAKE) --no-print-directory $(BUILD)/tests/bench/odometry; fi
reproduce-tools: $(BUILD)/tests/reproduce/drift $(BUILD)/tests/reproduce/verdict $(BUILD)/tests/reproduce/scene_distance

.PHONY: tests
.SECONDARY:
tests: $(TESTS)

check: deps
	@$(MAKE) --no-print-directory $(PARALLEL) programs tests reproduce-tools
	@$(MAKE) --no-print-directory $(PARALLEL) BUILD=$(BUILD)/sanitize SANITIZE=address,undefined OPTIMISE='-O1 -g' programs tests
	sh tests/run.sh $(BUILD)

-include $(shell find $(BUILD) -type f '(' -name '*.c.d' -o -name '*.cpp.d' -o -name kernels.d ')' 2>/dev/null)
