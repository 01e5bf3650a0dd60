# fathom: make help lists the targets.
# Objects go to $(BUILD); a second flavour is built beside it by giving another BUILD (and SANITIZE=address,undefined).

BUILD    ?= build
PREFIX   ?= /usr/local
SANITIZE ?=
DEBIAN_PACKAGES = gcc g++ libc6-dev pkg-config binutils ocl-icd-opencl-dev opencl-c-headers pocl-opencl-icd libeigen3-dev \
                  libpng-dev libcmocka-dev oclgrind python3

VERSION_MAJOR := $(shell sed -n 's/.define FATHOM_VERSION_MAJOR *//p' lib/fathom.h)
VERSION_MINOR := $(shell sed -n 's/.define FATHOM_VERSION_MINOR *//p' lib/fathom.h)
VERSION_PATCH := $(shell sed -n 's/.define FATHOM_VERSION_PATCH *//p' lib/fathom.h)
VERSION := $(VERSION_MAJOR).$(VERSION_MINOR).$(VERSION_PATCH)

ifdef SANITIZE
SAN_FLAGS = -fsanitize=$(SANITIZE) -fno-sanitize-recover=all -fno-omit-frame-pointer
endif
OPTIMISE ?= -O2 -g
WARN     = -Wall -Wextra -Wshadow -Wpointer-arith -Wvla
CPPFLAGS += -Ilib -Idrivers -MMD -MP
ALL_CFLAGS   = -std=c11 -D_GNU_SOURCE $(OPTIMISE) $(WARN) -Wstrict-prototypes -Wmissing-prototypes -fPIC \
               -fvisibility=hidden -ffp-contract=off $(SAN_FLAGS) $(CFLAGS)
ALL_CXXFLAGS = -std=c++17 -D_GNU_SOURCE $(OPTIMISE) $(WARN) -fPIC -fvisibility=hidden -fvisibility-inlines-hidden \
               -ffp-contract=off -fno-exceptions -fno-rtti -DEIGEN_NO_MALLOC \
               $(shell pkg-config --cflags eigen3 2>/dev/null | sed 's/-I/-isystem /g') $(SAN_FLAGS) $(CXXFLAGS)
ALL_LDFLAGS  = $(SAN_FLAGS) $(LDFLAGS)

KERNELS     = opencl/common.cl $(filter-out opencl/common.cl,$(sort $(wildcard opencl/*.cl)))
LIB_OBJ     = $(patsubst %,$(BUILD)/%.o,$(wildcard lib/*.c lib/*.cpp)) $(BUILD)/kernels.o
DRIVERS_OBJ = $(patsubst %,$(BUILD)/%.o,$(wildcard drivers/*.c))
CLI_OBJ     = $(patsubst %,$(BUILD)/%.o,$(wildcard examples/cli/*.c))
LIB_SO      = $(BUILD)/libfathom.so.$(VERSION)
DRIVERS_A   = $(BUILD)/libfathom-drivers.a
LIB_LIBS    = -lOpenCL -lpthread -lm
DRIVERS_LIBS = $(shell pkg-config --libs libpng 2>/dev/null) -lpthread -lm

.PHONY: all deps demo check bench install uninstall clean help objects
.DELETE_ON_ERROR:

all: deps-check $(BUILD)/libfathom.so $(BUILD)/libfathom.a $(DRIVERS_A) $(BUILD)/fathom

.PHONY: deps-check
deps-check:
	@pkg-config --exists eigen3 libpng OpenCL 2>/dev/null || { echo "make: eigen3, libpng or OpenCL is missing: run 'make deps' first" >&2; exit 1; }

$(BUILD)/%.c.o: %.c Makefile
	@mkdir -p $(@D)
	$(CC) $(CPPFLAGS) $(ALL_CFLAGS) -c $< -o $@

$(BUILD)/%.cpp.o: %.cpp Makefile
	@mkdir -p $(@D)
	$(CXX) $(CPPFLAGS) $(ALL_CXXFLAGS) -c $< -o $@

# The kernels' text, one C string a file, so that nothing has to be installed beside the library.
$(BUILD)/kernels.c: $(KERNELS) lib/embed.sh
	@mkdir -p $(@D)
	sh lib/embed.sh $(KERNELS) > $@

$(BUILD)/kernels.o: $(BUILD)/kernels.c
	$(CC) $(CPPFLAGS) $(ALL_CFLAGS) -c $< -o $@

$(LIB_SO): $(LIB_OBJ)
	$(CXX) -shared -Wl,-soname,libfathom.so.$(VERSION_MAJOR) -Wl,--no-undefined -o $@ $^ $(ALL_LDFLAGS) $(LIB_LIBS)

$(BUILD)/libfathom.so: $(LIB_SO)
	ln -sf libfathom.so.$(VERSION) $(BUILD)/libfathom.so.$(VERSION_MAJOR)
	ln -sf libfathom.so.$(VERSION_MAJOR) $@

$(BUILD)/libfathom.a: $(LIB_OBJ)
	rm -f $@
	$(AR) rcs $@ $^

$(DRIVERS_A): $(DRIVERS_OBJ)
	rm -f $@
	$(AR) rcs $@ $^

$(BUILD)/fathom: $(CLI_OBJ) $(DRIVERS_A) $(BUILD)/libfathom.a
	$(CXX) -o $@ $(CLI_OBJ) $(DRIVERS_A) $(BUILD)/libfathom.a $(ALL_LDFLAGS) $(DRIVERS_LIBS) $(LIB_LIBS)

-include $(shell find $(BUILD) -name '*.d' 2>/dev/null)
